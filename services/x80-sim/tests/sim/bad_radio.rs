//! Tests of a whole simulated robot behind a bad radio.

use common::{
    clock::Pace,
    ground_truth::GroundTruthTick,
    wire::{Decoder, Report},
};

use crate::support::{Sim, forward, receive, reports};

/// Drives in lockstep for `rounds` of `at_once` commands. Returns received bytes and ground truth.
fn lock_step(mission: &str, rounds: usize, at_once: usize) -> (Vec<u8>, Vec<GroundTruthTick>) {
    let sim = Sim::start(mission, Pace::Max);
    let host = sim.host();
    let mut bytes = Vec::new();
    let mut motor_frames = 0;
    let mut decoder = Decoder::default();
    for _ in 0..rounds {
        for _ in 0..at_once {
            host.send(&forward(400, 150)).unwrap();
        }
        let before = motor_frames;
        while motor_frames < before + at_once {
            let datagram = receive(&host);
            decoder.push(&datagram);
            bytes.extend(datagram);
            while let Some(frame) = decoder.next_frame() {
                motor_frames += usize::from(matches!(Report::parse(&frame), Ok(Report::Motor(_))));
            }
        }
    }
    // Ground truth is written before a tick's frames.
    (bytes, sim.truth())
}

const OUT_HALF_THE_TIME: &str = "robot.rate_hz = 20\nperimeter.width_m = 200\n[simulation.radio]\noutage_share = 0.5\noutage_mean_s = 0.7\nsplit_share = 0.2\ndelay_s = 0.005\njitter_s = 0.003";

#[test]
fn in_lock_step_time_passes_through_an_outage_and_the_run_can_be_had_again() {
    let (bytes, ground_truth) = lock_step(OUT_HALF_THE_TIME, 400, 1);
    // Commands that come early and wait give the same run.
    for (rounds, at_once) in [(400, 1), (200, 2)] {
        let (again, truth_again) = lock_step(OUT_HALF_THE_TIME, rounds, at_once);
        assert!(bytes == again && ground_truth == truth_again, "the same seed gave another run");
    }
    assert!(ground_truth.len() > 600, "400 commands and {} ticks", ground_truth.len());
    let radio = ground_truth.last().unwrap().radio.unwrap();
    assert!(radio.lost > 200 && radio.longest_outage_s > 0.5, "{radio:?}");
    let numbers: Vec<u64> = ground_truth.iter().map(|tick| tick.tick).collect();
    assert_eq!(numbers, (0..ground_truth.len() as u64).collect::<Vec<_>>());
}

#[test]
fn in_lock_step_a_lost_command_is_not_acknowledged_and_moves_nothing() {
    let mission =
        "perimeter.width_m = 200\nsimulation.wheels.lag_s = 0\nsimulation.radio.loss_share = 0.3";
    let (bytes, ground_truth) = lock_step(mission, 200, 1);
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
        lock_step(&mission, 1, 1).1[1].right_counts
    };
    // The wheel turns 400 counts/s for a period of 50 ms, less the delay there and back.
    assert_eq!([counts("0"), counts("0.01"), counts("0.04")], [20, 12, 0]);
}

#[test]
fn in_an_outage_a_robot_that_obeys_time_or_minds_silence_is_soon_at_rest() {
    let own_limits = ["", "\n[simulation]\nignores_time = true\nstops_when_silent_s = 0.15"];
    for own in own_limits {
        let radio =
            OUT_HALF_THE_TIME.replace("[simulation.radio]", &format!("{own}\n[simulation.radio]"));
        let (_, ground_truth) = lock_step(&radio, 400, 1);
        let mut out_since = None;
        let mut outages_at_rest = 0;
        for tick in &ground_truth {
            if !tick.radio.unwrap().out {
                out_since = None;
                continue;
            }
            let since = *out_since.get_or_insert(tick.time_s);
            // A command just before the outage lasts 0.15 s, the loop's lag 0.26 s more.
            if tick.time_s - since > 0.15 + 0.3 {
                outages_at_rest += 1;
                assert_eq!(tick.v, 0.0, "it still moves: {tick:?}");
            }
        }
        assert!(outages_at_rest > 5, "only {outages_at_rest} ticks of long outages");
    }
}

#[test]
fn at_a_rate_every_frame_that_comes_through_the_worst_radio_is_sound() {
    let sim = Sim::start(
        "robot.rate_hz = 50\n[simulation.radio]\nloss_share = 0.1\ndelay_s = 0.02\njitter_s = 0.02\nduplicate_share = 0.1\nreorder_share = 0.1\nsplit_share = 0.1\nmerge_share = 0.1",
        Pace::Rate(5.0),
    );
    let host = sim.host();
    let mut decoder = Decoder::default();
    let mut motor_frames = 0;
    while motor_frames < 100 {
        // Without a peer, the robot sends nothing until a command arrives.
        host.set_read_timeout(Some(std::time::Duration::from_millis(20))).unwrap();
        host.send(&forward(0, 150)).unwrap();
        let mut buffer = [0; 4096];
        let Ok(length) = host.recv(&mut buffer) else {
            continue;
        };
        decoder.push(&buffer[..length]);
        while let Some(frame) = decoder.next_frame() {
            let report = Report::parse(&frame).expect("a frame that is sound is a report");
            motor_frames += usize::from(matches!(report, Report::Motor(_)));
        }
    }
    let last = sim.truth().pop().unwrap();
    assert!(last.tick < 400, "100 motor frames of {} ticks", last.tick);
    assert!(last.radio.unwrap().lost > 0);
}
