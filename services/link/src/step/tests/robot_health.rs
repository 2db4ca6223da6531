//! Tests with a robot whose frames are implausible or missing.

use super::*;
use common::wire::{COUNT_CYCLE, Quantity};

const STAND: [Option<i16>; 2] = [Some(0), Some(0)];
/// One turn per second, 1200 counts/s.
const TURN: f64 = std::f64::consts::TAU;

/// Runs wall-clock ticks, always commanded to drive, with frames `frames(tick)`. Returns decisions
/// with mission milliseconds.
fn drive(
    link: &mut Link,
    numbers: std::ops::Range<u64>,
    frames: impl Fn(u64) -> Vec<u8>,
) -> Vec<(u64, Action, Cause)> {
    let mut all = Vec::new();
    for number in numbers {
        let now = number * PERIOD_NS;
        let mut effects = link.at(Event::Order(Order::Drive, HoldReason::None), now);
        effects.extend(link.at(Event::Datagram(&frames(number)), now));
        effects.extend(link.at(Event::Command(command(number, now, TURN, TURN)), now + MS));
        let decisions = decided(&effects).into_iter();
        all.extend(decisions.map(|(action, cause)| (now / MS, action, cause)));
    }
    all
}

fn ack() -> Vec<u8> {
    let mut bytes = Vec::new();
    Report::System(SystemSignal::Ack).encode(Addressing::default(), &mut bytes);
    bytes
}

#[test]
fn a_robot_whose_counts_stay_while_it_is_told_to_drive_stands_in_time_and_its_mission_ends() {
    let mut link = driving(on_the_wall());
    let decisions = drive(&mut link, 0..90, |_| datagram(255, 0, 0));
    let suspected = (Action::Stop, Cause::OdometryImplausible);
    let given_up = (Action::End, Cause::OdometryGivenUp);
    let what: Vec<_> = decisions.iter().map(|&(_, action, cause)| (action, cause)).collect();
    assert_eq!(what[what.len() - 2..], [suspected, given_up]);
    let [(stood, ..), (ended, ..)] = decisions[what.len() - 2..] else {
        panic!();
    };
    assert!(stood < 1200 && (10_000..10_200).contains(&(ended - stood)), "{decisions:?}");
    assert!(link.explain(Cause::OdometryGivenUp, 0).unwrap().contains("left wheel"));
}

#[test]
fn an_operators_stop_and_resume_let_a_suspected_robot_go_on_and_its_wait_is_no_end() {
    let mut link = driving(on_the_wall());
    drive(&mut link, 0..10, |_| datagram(255, 0, 0));
    assert_eq!(link.decision.cause, Cause::OdometryImplausible);
    let stop = Event::Order(Order::Hold, HoldReason::Operator);
    for number in 10..100 {
        link.at(stop, number * PERIOD_NS);
        link.at(Event::Datagram(&datagram(255, 0, 0)), number * PERIOD_NS);
    }
    assert_eq!(link.decision.cause, Cause::OperatorStop);
    assert!(link.is_at_rest());
    drive(&mut link, 100..101, |_| datagram(255, 0, 0));
    assert_eq!(link.decision, Decision::GO);
}

#[test]
fn counts_that_cannot_be_true_give_no_tick() {
    let mut link = driving(on_the_wall());
    assert_eq!(ticks(&link.at(Event::Datagram(&datagram(255, 0, 0)), 10 * MS)).len(), 1);
    let old = link.at(Event::Datagram(&datagram(255, 9000, 9000)), 150 * MS);
    assert_eq!(ticks(&old), []);
    let good = ticks(&link.at(Event::Datagram(&datagram(255, 0, 10)), 290 * MS));
    assert_eq!((good[0].2.right_counts, good[0].2.restarts), (10, 0));
}

#[test]
fn a_robot_that_rolls_on_when_it_is_to_stand_is_told_by_every_method_in_turn() {
    let mut link = driving(on_the_wall());
    let (mut tried, mut seen) = (Vec::new(), None);
    for number in 0..30 {
        let now = number * PERIOD_NS;
        let rolled = (80 * number) as u16;
        let frames = datagram(255, rolled, 32_000 - rolled);
        let mut effects = link.at(Event::Order(Order::Hold, HoldReason::Operator), now);
        effects.extend(link.at(Event::Datagram(&frames), now));
        effects.extend(link.at(Event::Quiet, now + 70 * MS));
        if decided(&effects).contains(&(Action::Stop, Cause::RobotDoesNotStop)) {
            seen.get_or_insert(now / MS);
        }
        for command in sent(&effects) {
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
    }
    assert!(seen.unwrap() < 1500, "{seen:?}");
    assert_eq!(tried[..4], [Some(0), Some(1), Some(99), None]);
    // It rests, and drives only after its motors are enabled.
    for number in 30..36 {
        let frames = datagram(255, 2320, 29_680);
        link.at(Event::Datagram(&frames), number * PERIOD_NS);
    }
    assert!(link.is_at_rest());
    assert_eq!(link.decision.cause, Cause::OperatorStop);
    let now = 36 * PERIOD_NS;
    link.at(Event::Order(Order::Drive, HoldReason::None), now);
    link.at(Event::Datagram(&datagram(255, 2320, 29_680)), now);
    let go = sent(&link.at(Event::Command(command(0, now, TURN, TURN)), now));
    assert!(go.iter().any(|it| matches!(it, Command::Enable { on: true, .. })), "{go:?}");
    assert!(matches!(go.last(), Some(Command::Motion(_))), "{go:?}");
}

#[test]
fn a_sonar_that_says_0_holds_the_robot_until_its_next_reading_and_255_is_one() {
    let mut link = driving(on_the_wall());
    let obeying = |sonar: u8, number: u64| {
        let rolled = 171 * number.min(10) as u16;
        datagram(sonar, 32_768 - rolled, rolled)
    };
    let decisions = drive(&mut link, 1..20, |number| obeying(u8::from(number < 5) * 255, number));
    let [.., (when, Action::Stop, Cause::RangeSilent)] = decisions[..] else {
        panic!("{decisions:?}");
    };
    let last_reading = 4 * PERIOD_NS / MS;
    assert!((750..900).contains(&(when - last_reading)), "{decisions:?}");
    let stopped_at = link.decision.cause;
    assert_eq!(stopped_at, Cause::RangeSilent);
    drive(&mut link, 20..21, |number| obeying(255, number));
    assert_eq!(link.decision, Decision::GO);
}

#[test]
fn a_robot_that_only_acknowledges_is_asked_for_its_streams_and_the_cause_is_named() {
    let mut link = driving(on_the_wall());
    let decisions = drive(&mut link, 0..3, |number| {
        let rolled = (171 * number) as u16;
        datagram(255, (32_768 - rolled) % 32_768, rolled)
    });
    assert_eq!(decisions, [(0, Action::Go, Cause::None)]);
    let (mut asked, mut causes) = (0, Vec::new());
    for number in 3..30 {
        let now = number * PERIOD_NS;
        let mut effects = link.at(Event::Order(Order::Drive, HoldReason::None), now);
        effects.extend(link.at(Event::Datagram(&ack()), now));
        causes.extend(decided(&effects).into_iter().map(|(_, cause)| cause));
        let streams = |command: &Command| matches!(command, Command::Stream { .. });
        asked += sent(&effects).into_iter().filter(streams).count();
        let stands = |velocity: &[Option<i16>; 2]| *velocity == STAND;
        assert!(number == 3 || velocities(&effects).iter().all(stands));
    }
    assert_eq!(causes, [Cause::CommandStale, Cause::FramesSilent]);
    assert_eq!(asked, 3 * 2, "three streams, twice in four seconds");
}

#[test]
fn a_robot_that_was_lost_and_acknowledges_what_was_sent_long_ago_is_not_driven() {
    let mut link = driving(on_the_wall());
    link.at(Event::Quiet, 1000 * MS);
    assert!(!link.connected());
    let mut moving = Vec::new();
    let mut causes = Vec::new();
    for number in 14..40 {
        let now = number * PERIOD_NS;
        let late = number < 28;
        let mut datagram = datagram(255, 0, 0);
        if late {
            datagram.extend(ack());
        }
        let mut effects = link.at(Event::Order(Order::Drive, HoldReason::None), now);
        effects.extend(link.at(Event::Datagram(&datagram), now));
        effects.extend(link.at(Event::Command(command(number, now, TURN, TURN)), now + MS));
        causes.extend(decided(&effects).into_iter().map(|(_, cause)| cause));
        if velocities(&effects).iter().any(|velocity| *velocity != STAND) {
            moving.push(number);
        }
    }
    assert_eq!(causes.first(), Some(&Cause::RobotLate), "{causes:?}");
    // Retested every 2 s.
    assert!(moving.first().is_some_and(|first| *first > 28), "{moving:?}");
    assert_eq!(causes.last(), Some(&Cause::None), "{causes:?}");
}

#[test]
fn wheels_that_reach_four_fifths_of_their_command_are_told_more_until_they_turn_as_commanded() {
    let mut link = driving(on_the_wall());
    let half = TURN / 2.0;
    let (mut turned, mut told) = (0.0, 0.0);
    for number in 0..60 {
        let now = (number + 1) * PERIOD_NS;
        turned += 0.8 * told / 7.0;
        let counts = |turned: f64| turned.rem_euclid(COUNT_CYCLE.into()) as u16;
        link.at(Event::Order(Order::Drive, HoldReason::None), now);
        link.at(Event::Datagram(&datagram(255, counts(-turned), counts(turned))), now);
        let effects = link.at(Event::Command(command(number, now, half, half)), now + MS);
        told = velocities(&effects)[0][1].unwrap().into();
    }
    assert!((0.8 * told - 600.0).abs() < 10.0, "{told}");
}

#[test]
fn on_the_wall_clock_a_second_command_for_a_tick_reaches_the_robot_too() {
    let mut link = driving(on_the_wall());
    link.at(Event::Datagram(&datagram(255, 0, 0)), PERIOD_NS);
    for speed in [TURN / 4.0, TURN / 2.0] {
        let answer = command(0, PERIOD_NS, speed, speed);
        let told = velocities(&link.at(Event::Command(answer), PERIOD_NS + MS));
        assert_eq!(told[0][1], Some((speed / TURN * 1200.0) as i16));
    }
    assert_eq!(link.tally.commands_out, 2);
}

#[test]
fn a_suspicion_outlasts_a_hold_that_is_no_operators() {
    let mut link = driving(on_the_wall());
    drive(&mut link, 0..10, |_| datagram(255, 0, 0));
    assert_eq!(link.decision.cause, Cause::OdometryImplausible);
    link.at(Event::Order(Order::Hold, HoldReason::StageHeld), 10 * PERIOD_NS);
    link.at(Event::Order(Order::Drive, HoldReason::None), 11 * PERIOD_NS);
    assert_eq!(link.decision.cause, Cause::OdometryImplausible);
}
