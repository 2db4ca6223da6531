//! Tests of a whole simulated robot behind a bad radio.

use common::{clock::Pace, ground_truth::GroundTruthTick, wire::Report};
use x80_sim::InMemory;

use crate::support::{forward, mission, port, reports};

/// Drives in lockstep by so many commands. Returns the bytes for the host, and the ground truth.
fn lock_step(text: &str, commands: usize) -> (Vec<u8>, Vec<GroundTruthTick>) {
    let mut robot = InMemory::start(&mission(text), Pace::Max).unwrap();
    for _ in 0..commands {
        robot.hear(port(7), &forward(400, 150)).unwrap();
    }
    let bytes = robot.sent().flat_map(|(_, datagram)| datagram).collect();
    (bytes, robot.truth)
}

#[test]
fn in_lock_step_a_lost_command_is_not_acknowledged_and_moves_nothing() {
    let mission =
        "perimeter.width_m = 200\nsimulation.wheels.lag_s = 0\nsimulation.radio.loss_share = 0.3";
    let (bytes, ground_truth) = lock_step(mission, 200);
    let is_ack = |report: &Report| matches!(report, Report::System(_));
    let acks = reports(&bytes).into_iter().filter(is_ack).count() as u16;
    assert!((120..160).contains(&acks), "{acks} of 200 commands were acknowledged");
    // The wheel turns 400 counts/s for the period of 1/7 s, or for all of the 150 ms if no command
    // follows.
    let counts = ground_truth.last().unwrap().right_counts;
    assert!((acks * 57..=acks * 60).contains(&counts), "{counts} counts for {acks} commands");
}

#[test]
fn in_lock_step_a_slow_radio_makes_commands_late() {
    let counts = |delay: &str| {
        let mission = format!(
            "robot.rate_hz = 20\nsimulation.wheels.lag_s = 0\nsimulation.radio.delay_s = {delay}"
        );
        lock_step(&mission, 1).1[1].right_counts
    };
    // The wheel turns 400 counts/s for a period of 50 ms, less the delay there and back.
    assert_eq!([counts("0"), counts("0.01"), counts("0.04")], [20, 12, 0]);
}
