//! Tests with a robot whose frames are implausible or missing.

use super::*;
use common::wire::Quantity;

const PERIOD_MS: u64 = 143;

/// Runs a tick on the wall clock with an order to drive, these frames, and a command.
fn tick(link: &mut Link, number: u64, frames: &[u8], speeds: [f64; 2]) -> Vec<Effect> {
    let ms = number * PERIOD_MS;
    [link.drive(ms), link.hears(frames, ms), link.told(number, ms, speeds)].concat()
}

fn suspected() -> Link {
    let mut link = driving(on_the_wall());
    for number in 0..10 {
        tick(&mut link, number, &rolled(0), [TURN; 2]);
    }
    assert_eq!(link.decision.cause, Cause::OdometryImplausible);
    link
}

#[test]
fn an_operators_stop_and_resume_let_a_suspected_robot_go_on_and_its_wait_is_no_end() {
    let mut link = suspected();
    for number in 10..100 {
        link.hold(HoldReason::Operator, number * PERIOD_MS);
        link.still(number * PERIOD_MS);
    }
    assert!(link.is_at_rest() && link.decision.cause == Cause::OperatorStop);
    tick(&mut link, 100, &rolled(0), [TURN; 2]);
    assert_eq!(link.decision, Decision::GO);
    // No other hold ends a suspicion.
    let mut link = suspected();
    link.hold(HoldReason::StageHeld, 10 * PERIOD_MS);
    link.drive(11 * PERIOD_MS);
    assert_eq!(link.decision.cause, Cause::OdometryImplausible);
}

#[test]
fn counts_that_cannot_be_true_give_no_tick() {
    let mut link = ticking();
    assert_eq!(ticks(&link.hears(&datagram(255, [9000; 2]), 150)), []);
    let (_, _, wheels) = ticks(&link.hears(&datagram(255, [0, 10]), 290))[0];
    assert_eq!((wheels.right_counts, wheels.restarts), (10, 0));
}

#[test]
fn a_robot_that_rolls_on_when_it_is_to_stand_is_told_by_every_method_in_turn() {
    let mut link = driving(on_the_wall());
    let mut tried = Vec::new();
    for number in 0..30 {
        let ms = number * PERIOD_MS;
        let rolls = rolled(80 * number as u16);
        let effects =
            [link.hold(HoldReason::Operator, ms), link.hears(&rolls, ms), link.quiet(ms + 70)];
        assert!(tried.is_empty() || link.decision.cause == Cause::RobotDoesNotStop);
        for command in sent(&effects.concat()) {
            match command {
                Command::Enable { on: false, channel } => tried.push(channel),
                Command::Motion(motion) if motion.quantity == Quantity::Pwm => {
                    assert_eq!([motion.targets.of(0), motion.targets.of(1)], [Some(16_384); 2]);
                    tried.push(Some(99));
                }
                Command::Motion(motion) => assert_eq!(motion.targets.of(1), Some(0)),
                _ => {}
            }
        }
        assert!(!link.is_at_rest());
        assert!(ms < 1500 || !tried.is_empty());
    }
    assert_eq!(tried[..4], [Some(0), Some(1), Some(99), None]);
    // It rests, and drives only after its motors are enabled.
    let rests = rolled(2320);
    for number in 30..36 {
        link.hears(&rests, number * PERIOD_MS);
    }
    assert!(link.is_at_rest() && link.decision.cause == Cause::OperatorStop);
    let go = sent(&tick(&mut link, 36, &rests, [TURN; 2]));
    let enables = go.iter().any(|it| matches!(it, Command::Enable { on: true, .. }));
    assert!(enables && matches!(go.last(), Some(Command::Motion(_))), "{go:?}");
}

#[test]
fn a_robot_that_was_lost_and_acknowledges_what_was_sent_long_ago_is_not_driven() {
    let mut link = driving(on_the_wall());
    link.quiet(1000);
    assert!(!link.connected());
    let (mut moving, mut found) = (None, Vec::new());
    for number in 14..40 {
        let late = if number < 28 { ack() } else { Vec::new() };
        let effects = tick(&mut link, number, &[rolled(0), late].concat(), [TURN; 2]);
        found.extend(decided(&effects).into_iter().map(|(_, cause)| cause));
        if !stands(&effects) {
            moving.get_or_insert(number);
        }
    }
    assert_eq!(found.first(), Some(&Cause::RobotLate), "{found:?}");
    // Retested every 2 s.
    assert!(moving.is_some_and(|first| first > 28), "{moving:?}");
    assert_eq!(found.last(), Some(&Cause::None), "{found:?}");
}

#[test]
fn wheels_that_reach_four_fifths_of_their_command_are_told_more_until_they_turn_as_commanded() {
    let mut link = driving(on_the_wall());
    let (mut turned, mut told) = (0.0, 0.0);
    for number in 1..61 {
        turned += 0.8 * told / 7.0;
        let effects = tick(&mut link, number, &rolled(on_wire(turned)), [TURN / 2.0; 2]);
        told = velocities(&effects)[0][1].unwrap().into();
    }
    near(0.8 * told, 600.0, 10.0);
}

#[test]
fn on_the_wall_clock_a_second_command_for_a_tick_reaches_the_robot_too() {
    let mut link = ticking();
    let told = [0.25, 0.5].map(|share| velocities(&link.told(0, 10, [share * TURN; 2]))[0][1]);
    assert_eq!(told, [Some(300), Some(600)]);
    assert_eq!(link.tally.commands_out, 2);
}
