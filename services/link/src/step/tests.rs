use super::*;
use std::path::Path;

use common::{
    clock::{MissionTime, Pace},
    samples::{
        Action, Cause, CommandSample, CommandState, CountsSample, HoldReason, Order, RangeReading,
        RangeStatus, Stamp, WheelSample,
    },
    wire::{
        Addressing, Command, CustomSensors, Decoder, Mode, MotorSensors, Parameter, Report,
        StandardSensors, SystemSignal,
    },
};

const MS: u64 = 1_000_000;
const PERIOD_NS: u64 = 142_857_142;

fn mission() -> Mission {
    // X80: 1200 counts per turn, left wheel on channel 0, reversed, right wheel on channel 1.
    let text = "target = [3, 0]\nsensors = 'front'";
    Mission::parse(text, Path::new("test.toml")).unwrap()
}

fn in_ticks() -> Link {
    from_tick(0)
}

fn from_tick(next_tick: u64) -> Link {
    let mut link = Link::new(&mission());
    let pace = Pace::Max;
    link.restore(State { pace, next_tick });
    link
}

fn on_the_wall() -> Link {
    let mut link = Link::new(&mission());
    let (pace, next_tick) = (Pace::Rate(1.0), 0);
    link.restore(State { pace, next_tick });
    link
}

/// Events at machine-clock readings; wall-clock missions begin at 0.
trait At {
    fn at(&mut self, event: Event<'_>, machine_ns: u64) -> Vec<Effect>;
}

impl At for Link {
    fn at(&mut self, event: Event<'_>, machine_ns: u64) -> Vec<Effect> {
        let now = match self.state.pace {
            Pace::Max => self.state.next_tick * PERIOD_NS,
            Pace::Rate(_) => machine_ns,
        };
        self.step(Entry { event, machine_ns, now: MissionTime(now) })
    }
}

fn datagram(sonar: u8, channel_0: u16, channel_1: u16) -> Vec<u8> {
    let mut standard = StandardSensors::default();
    standard.ultrasonic[1] = sonar;
    let mut motor = MotorSensors::default();
    motor.encoders[0].position = channel_0;
    motor.encoders[1].position = channel_1;
    let mut bytes = Vec::new();
    Report::Standard(standard).encode(Addressing::default(), &mut bytes);
    Report::Motor(motor).encode(Addressing::default(), &mut bytes);
    bytes
}

fn command(tick: u64, time_ns: u64, left: f64, right: f64) -> CommandSample {
    CommandSample {
        stamp: Stamp { tick, stamp_ns: time_ns, ..Stamp::default() },
        pose_ns: time_ns,
        guidance_ns: time_ns,
        left_rad_s: left,
        right_rad_s: right,
        state: CommandState::Driving.into(),
        ..CommandSample::default()
    }
}

fn driving(mut link: Link) -> Link {
    link.at(Event::Datagram(&datagram(255, 0, 0)), 0);
    link.at(Event::Order(Order::Drive, HoldReason::None), 0);
    link
}

fn sent(effects: &[Effect]) -> Vec<Command> {
    let mut decoder = Decoder::default();
    for effect in effects {
        if let Effect::Send(bytes) = effect {
            decoder.push(bytes);
        }
    }
    let mut commands = Vec::new();
    while let Some(frame) = decoder.next_frame() {
        commands.push(Command::parse(&frame).unwrap());
    }
    commands
}

fn velocities(effects: &[Effect]) -> Vec<[Option<i16>; 2]> {
    let motion = |command: Command| match command {
        Command::Motion(motion) => Some([motion.targets.of(0), motion.targets.of(1)]),
        _ => None,
    };
    sent(effects).into_iter().filter_map(motion).collect()
}

fn decided(effects: &[Effect]) -> Vec<(Action, Cause)> {
    let decision = |effect: &Effect| match effect {
        Effect::Decided { now, .. } => Some((now.action, now.cause)),
        _ => None,
    };
    effects.iter().filter_map(decision).collect()
}

fn ticks(effects: &[Effect]) -> Vec<(u64, Vec<RangeReading>, WheelSample)> {
    let tick = |effect: &Effect| match effect {
        Effect::Tick { tick, ranges, wheels, .. } => Some((*tick, ranges.clone(), *wheels)),
        _ => None,
    };
    effects.iter().filter_map(tick).collect()
}

#[test]
fn a_link_pings_until_the_robot_answers_and_then_sets_it_up() {
    let mut link = on_the_wall();
    let ping = Command::System(SystemSignal::Ping);
    let first = sent(&link.at(Event::Quiet, 0));
    assert_eq!((first.len(), &first[0]), (1 + STOPS as usize, &ping), "{first:?}");
    assert_eq!(sent(&link.at(Event::Quiet, 100 * MS)), []);
    let again = sent(&link.at(Event::Quiet, 200 * MS));
    // A silent robot may still receive.
    assert_eq!((again.len(), &again[0]), (2, &ping), "{again:?}");
    let effects = link.at(Event::Datagram(&datagram(255, 0, 0)), 201 * MS);
    assert!(effects.contains(&Effect::Connected(true)));
    let setup = sent(&effects);
    assert_eq!(setup.len(), 9 + STOPS as usize, "{setup:?}");
    let later = sent(&link.at(Event::Quiet, 400 * MS));
    assert!(!later.contains(&ping), "{later:?}");
}

#[test]
fn a_wire_that_goes_down_is_a_robot_lost_and_nothing_is_sent_until_it_is_back() {
    let mut link = driving(on_the_wall());
    let half = &datagram(80, 0, 0)[..20];
    link.at(Event::Datagram(half), 10 * MS);
    let effects = link.at(Event::Wire(false), 11 * MS);
    assert!(effects.contains(&Effect::Connected(false)));
    assert_eq!(link.at(Event::Quiet, 1000 * MS), []);
    let effects = link.at(Event::Wire(true), 1001 * MS);
    assert_eq!(sent(&effects)[0], Command::System(SystemSignal::Ping));
    assert_eq!(velocities(&effects), [[Some(0), Some(0)]; STOPS as usize]);
    let effects = link.at(Event::Datagram(&datagram(80, 0, 0)), 1002 * MS);
    assert!(effects.contains(&Effect::Connected(true)));
    assert_eq!(ticks(&effects)[0].1[0].raw, 80, "{effects:?}");
}

#[test]
fn a_robot_that_stays_away_is_pinged_ever_less_often_and_heard_at_once() {
    let mut link = on_the_wall();
    let ping = Command::System(SystemSignal::Ping);
    let mut pings = Vec::new();
    for now in (0..8000).step_by(20) {
        if sent(&link.at(Event::Quiet, now * MS)).contains(&ping) {
            pings.push(now);
        }
    }
    assert_eq!(pings, [0, 200, 600, 1400, 3000, 5000, 7000]);
    let absence = link.absence(7900 * MS);
    let expected = Absence { lost_ns: 7900 * MS, pings: 7, next_ping_ns: 1100 * MS };
    assert_eq!(absence, expected);
    let effects = link.at(Event::Datagram(&datagram(255, 0, 0)), 7950 * MS);
    assert!(effects.contains(&Effect::Connected(true)));
    assert_eq!(link.absence(7960 * MS), Absence::default());
    // A robot lost again is pinged at once and often.
    let effects = link.at(Event::Quiet, 8700 * MS);
    assert!(effects.contains(&Effect::Connected(false)) && sent(&effects).contains(&ping));
    assert!(sent(&link.at(Event::Quiet, 8900 * MS)).contains(&ping));
    assert_eq!(link.losses(), 1);
}

#[test]
fn a_robot_that_restarted_its_counts_is_noticed_and_set_up_again() {
    let mut link = driving(on_the_wall());
    let effects = link.at(Event::Datagram(&datagram(255, 32_368, 400)), 10 * MS);
    assert_eq!(ticks(&effects)[0].2.restarts, 0);
    link.at(Event::Quiet, 1000 * MS);
    let effects = link.at(Event::Datagram(&datagram(255, 0, 0)), 3000 * MS);
    assert!(effects.contains(&Effect::Restarted));
    assert_eq!(ticks(&effects)[0].2.restarts, 1);
    assert_eq!(link.restarts(), 1);
    // The same after an unnoticed absence.
    link.at(Event::Datagram(&datagram(255, 31_168, 1600)), 3500 * MS);
    let effects = link.at(Event::Datagram(&datagram(255, 0, 0)), 3600 * MS);
    assert!(effects.contains(&Effect::Restarted));
    let mode = |command: &Command| {
        let velocity = Parameter::Mode(Mode::Velocity);
        matches!(command, Command::Parameter { parameter, .. } if *parameter == velocity)
    };
    let setup = sent(&effects);
    assert_eq!(setup.iter().filter(|command| mode(command)).count(), 2);
}

#[test]
fn a_robot_that_comes_back_with_its_counts_has_not_restarted() {
    let mut link = driving(on_the_wall());
    link.at(Event::Datagram(&datagram(255, 32_168, 600)), 10 * MS);
    link.at(Event::Quiet, 1000 * MS);
    let effects = link.at(Event::Datagram(&datagram(255, 32_100, 668)), 3000 * MS);
    assert!(effects.contains(&Effect::Connected(true)));
    assert_eq!(ticks(&effects)[0].2.restarts, 0);
}

/// Returns channel 1's target and the time limit of velocity commands.
fn timed(effects: &[Effect]) -> Vec<(Option<i16>, Option<u16>)> {
    let motion = |command: Command| match command {
        Command::Motion(motion) => Some((motion.targets.of(1), motion.limit_ms)),
        _ => None,
    };
    sent(effects).into_iter().filter_map(motion).collect()
}

#[test]
fn a_command_is_sent_again_once_halfway_to_the_next_tick_with_what_remains_of_its_time() {
    let mut link = driving(on_the_wall());
    link.at(Event::Datagram(&datagram(255, 0, 0)), 10 * MS);
    let turn = std::f64::consts::TAU;
    let effects = link.at(Event::Command(command(0, 10 * MS, turn, turn)), 12 * MS);
    assert_eq!(timed(&effects), [(Some(1200), Some(250))]);
    // Repeated half of 142.9 ms after the tick.
    assert_eq!(timed(&link.at(Event::Quiet, 81 * MS)), []);
    let effects = link.at(Event::Quiet, 90 * MS);
    assert_eq!(timed(&effects), [(Some(1200), Some(170))]);
    assert_eq!(timed(&link.at(Event::Quiet, 140 * MS)), [], "once");
    assert_eq!((link.tally.commands_out, link.tally.repeated_commands), (1, 1));
}

#[test]
fn a_command_whose_successor_is_due_is_not_sent_again() {
    let mut link = driving(on_the_wall());
    link.at(Event::Datagram(&datagram(255, 0, 0)), 10 * MS);
    link.at(Event::Command(command(0, 10 * MS, 1.0, 1.0)), 12 * MS);
    link.at(Event::Datagram(&datagram(255, 0, 0)), 75 * MS);
    assert_eq!(timed(&link.at(Event::Quiet, 90 * MS)), []);
}

#[test]
fn a_command_that_no_longer_holds_is_not_sent_again() {
    for (event, at) in [
        (Event::Order(Order::Hold, HoldReason::Operator), 20),
        (Event::Wire(false), 20),
        (Event::Quiet, 270),
    ] {
        let mut link = driving(on_the_wall());
        link.at(Event::Datagram(&datagram(255, 0, 0)), 10 * MS);
        link.at(Event::Command(command(0, 10 * MS, 1.0, 1.0)), 12 * MS);
        link.at(event, at * MS);
        let effects = link.at(Event::Quiet, (at + 70) * MS);
        let moves = |(target, _): &(Option<i16>, _)| *target != Some(0);
        assert!(!timed(&effects).iter().any(moves), "{event:?}");
    }
}

#[test]
fn what_a_frame_carries_besides_the_tick_is_told_even_while_nothing_drives() {
    let mut link = on_the_wall();
    let mut bytes = datagram(255, 0, 0);
    let custom = CustomSensors::default();
    Report::Custom(custom).encode(Addressing::default(), &mut bytes);
    let effects = link.at(Event::Datagram(&bytes), 0);
    for reported in [
        |effect: &Effect| matches!(effect, Effect::Infrared(_)),
        |effect: &Effect| matches!(effect, Effect::Power(_)),
        |effect: &Effect| matches!(effect, Effect::Surroundings(_)),
    ] {
        assert_eq!(effects.iter().filter(|effect| reported(effect)).count(), 1);
    }
    assert!(ticks(&effects).is_empty());
}

#[test]
fn a_tick_has_the_infrared_counts_that_came_with_it_and_the_next_without_any_has_none() {
    let mut link = driving(on_the_wall());
    let mut bytes = Vec::new();
    let custom = CustomSensors { ad: [0, 0, 602, 603, 604, 605, 606, 607], io: 0 };
    Report::Custom(custom).encode(Addressing::default(), &mut bytes);
    let standard = StandardSensors { infrared: 601, ..StandardSensors::default() };
    Report::Standard(standard).encode(Addressing::default(), &mut bytes);
    Report::Motor(MotorSensors::default()).encode(Addressing::default(), &mut bytes);
    let given = ticks(&link.at(Event::Datagram(&bytes), 10 * MS));
    let counts =
        |ranges: &[RangeReading]| ranges[3..].iter().map(|reading| reading.raw).collect::<Vec<_>>();
    assert_eq!(counts(&given[0].1), [601, 602, 603, 604, 605, 606, 607]);
    let given = ticks(&link.at(Event::Datagram(&datagram(255, 0, 0)), 150 * MS));
    assert_eq!(counts(&given[0].1), [0; 7]);
}

#[test]
fn a_robot_found_driving_is_told_to_stand_until_a_command_comes() {
    // The previous link was killed, and the robot ignores its last command's limit.
    let mut link = on_the_wall();
    let effects = link.at(Event::Datagram(&datagram(255, 0, 0)), 0);
    assert_eq!(velocities(&effects), [[Some(0), Some(0)]; STOPS as usize]);
    assert!(velocities(&link.at(Event::Order(Order::Drive, HoldReason::None), MS)).is_empty());
    let effects = link.at(Event::Quiet, 201 * MS);
    assert_eq!(velocities(&effects), [[Some(0), Some(0)]]);
}

#[test]
fn a_command_older_than_the_newest_is_ignored() {
    let mut link = driving(on_the_wall());
    link.at(Event::Datagram(&datagram(255, 0, 0)), 10 * MS);
    link.at(Event::Datagram(&datagram(255, 0, 0)), 150 * MS);
    link.at(Event::Command(command(1, 150 * MS, 1.0, 1.0)), 151 * MS);
    let old = command(0, 10 * MS, -1.0, -1.0);
    assert!(link.at(Event::Command(old), 152 * MS).is_empty());
}

#[test]
fn a_command_from_the_future_moves_nothing() {
    let mut link = driving(on_the_wall());
    link.at(Event::Datagram(&datagram(255, 0, 0)), 10 * MS);
    let future = command(0, 900 * MS, 1.0, 1.0);
    let moves = |velocity: &[Option<i16>; 2]| *velocity != [Some(0), Some(0)];
    let effects = link.at(Event::Command(future), 11 * MS);
    assert!(!velocities(&effects).iter().any(moves), "{effects:?}");
}

#[test]
fn a_tick_carries_the_newest_sonar_and_forward_counts() {
    let mut link = driving(on_the_wall());
    // Channel 0 counts down driving forward: 32768 - 100 is 100 counts forward.
    let effects = link.at(Event::Datagram(&datagram(80, 32_668, 250)), 10 * MS);
    let [(tick, ranges, wheels)] = &ticks(&effects)[..] else {
        panic!("{effects:?}");
    };
    assert_eq!((*tick, wheels.left_counts, wheels.right_counts), (0, 100, 250));
    assert_eq!((ranges[0].range_m, ranges[0].raw), (0.8, 80));
    assert_eq!(ranges[0].status(), RangeStatus::Measured);
}

#[test]
fn a_motor_frame_alone_makes_a_tick_without_a_reading() {
    let mut link = driving(on_the_wall());
    let mut bytes = Vec::new();
    Report::Motor(MotorSensors::default()).encode(Addressing::default(), &mut bytes);
    link.at(Event::Datagram(&datagram(80, 0, 0)), MS);
    let effects = link.at(Event::Datagram(&bytes), 2 * MS);
    assert_eq!(ticks(&effects)[0].1[0].status(), RangeStatus::Absent);
}

#[test]
fn a_command_reaches_the_wheels_signed_timed_and_in_counts() {
    let mut link = driving(on_the_wall());
    link.at(Event::Datagram(&datagram(255, 0, 0)), 10 * MS);
    // One turn per second: 1200 counts/s, below the top speed of 2247.
    let turn = std::f64::consts::TAU;
    let effects = link.at(Event::Command(command(0, 10 * MS, turn, -0.5 * turn)), 11 * MS);
    assert_eq!(velocities(&effects), [[Some(-1200), Some(-600)]]);
    assert!(effects.contains(&Effect::Answered { began_ns: 10 * MS }));
    let Command::Motion(motion) = sent(&effects)[0] else {
        panic!();
    };
    assert_eq!(motion.limit_ms, Some(250));
}

#[test]
fn no_number_moves_no_wheel() {
    let mut link = driving(on_the_wall());
    link.at(Event::Datagram(&datagram(255, 0, 0)), 10 * MS);
    let effects = link.at(Event::Command(command(0, 10 * MS, f64::NAN, 1e300)), 11 * MS);
    // NaN becomes 0; other speeds are limited to 1 m/s.
    assert_eq!(velocities(&effects), [[Some(0), Some(2247)]]);
}

#[test]
fn a_stale_command_stops_the_robot_three_times_and_keeps_telling() {
    let mut link = driving(on_the_wall());
    link.at(Event::Datagram(&datagram(255, 0, 0)), 10 * MS);
    link.at(Event::Command(command(0, 10 * MS, 1.0, 1.0)), 11 * MS);
    let again = velocities(&link.at(Event::Quiet, 200 * MS));
    assert_eq!(again.len(), 1, "the command once more");
    assert!(link.at(Event::Quiet, 260 * MS).is_empty(), "not yet over 250 ms");
    let effects = link.at(Event::Quiet, 261 * MS);
    assert_eq!(velocities(&effects), [[Some(0), Some(0)]; 3]);
    assert_eq!(decided(&effects), [(Action::Stop, Cause::CommandStale)]);
    assert!(link.at(Event::Quiet, 262 * MS).is_empty(), "said");
    assert_eq!(velocities(&link.at(Event::Quiet, 462 * MS)), [[Some(0), Some(0)]]);
}

#[test]
fn the_supervisors_stop_stops_the_robot_and_later_commands_do_not_move_it() {
    let mut link = driving(on_the_wall());
    link.at(Event::Datagram(&datagram(255, 0, 0)), 10 * MS);
    link.at(Event::Command(command(0, 10 * MS, 1.0, 1.0)), 11 * MS);
    let effects = link.at(Event::Order(Order::Stop, HoldReason::Ending), 20 * MS);
    assert_eq!(velocities(&effects), [[Some(0), Some(0)]; 3]);
    let effects = link.at(Event::Command(command(1, 20 * MS, 1.0, 1.0)), 21 * MS);
    assert!(velocities(&effects).is_empty());
}

#[test]
fn a_silent_robot_is_lost_told_to_stand_and_pinged() {
    let mut link = driving(on_the_wall());
    link.at(Event::Datagram(&datagram(255, 0, 0)), 10 * MS);
    link.at(Event::Command(command(0, 10 * MS, 1.0, 1.0)), 11 * MS);
    let effects = link.at(Event::Quiet, 800 * MS);
    assert!(effects.contains(&Effect::Connected(false)));
    assert!(sent(&effects).contains(&Command::System(SystemSignal::Ping)));
    let effects = link.at(Event::Datagram(&datagram(255, 0, 0)), 900 * MS);
    assert!(effects.contains(&Effect::Connected(true)));
    assert_eq!(ticks(&effects)[0].0, 1, "the mission goes on with the next tick");
}

#[test]
fn a_robot_that_another_host_commands_is_told_to_stand_after_each_acknowledgement_of_its_commands()
{
    let mut link = driving(on_the_wall());
    let mut acknowledged = Vec::new();
    Report::System(SystemSignal::Ack).encode(Addressing::default(), &mut acknowledged);
    let mut causes = Vec::new();
    // The robot, found at 0 s, acknowledges another host's commands too from 5 s on.
    for (tick, ms) in (0..100).map(|tick| (tick, 100 * (tick + 1))) {
        let mut effects = link.at(Event::Datagram(&datagram(255, 0, 0)), ms * MS);
        effects.extend(link.at(Event::Order(Order::Drive, HoldReason::None), ms * MS));
        effects.extend(link.at(Event::Command(command(tick, ms * MS, 0.0, 0.0)), ms * MS));
        causes.extend(decided(&effects).into_iter().map(|(_, cause)| (ms, cause)));
        for _ in sent(&effects) {
            link.at(Event::Datagram(&acknowledged), ms * MS);
        }
        if ms >= 5000 {
            let stops = causes.last().is_some_and(|(_, cause)| *cause == Cause::AnotherCommander);
            let effects = link.at(Event::Datagram(&acknowledged), ms * MS + MS);
            assert!(!stops || !velocities(&effects).is_empty(), "it obeys the newest command");
            causes.extend(decided(&effects).into_iter().map(|(_, cause)| (ms, cause)));
            for _ in sent(&effects) {
                link.at(Event::Datagram(&acknowledged), ms * MS + MS);
            }
        }
    }
    let at = causes.iter().find(|(_, cause)| *cause == Cause::AnotherCommander);
    assert!(at.is_some_and(|(ms, _)| *ms >= 5000), "{causes:?}");
}

#[test]
fn an_abandoned_tick_does_not_keep_the_next_from_starting() {
    let mut link = driving(on_the_wall());
    let first = link.at(Event::Datagram(&datagram(255, 0, 0)), 10 * MS);
    let second = link.at(Event::Datagram(&datagram(255, 0, 0)), 150 * MS);
    assert_eq!((ticks(&first)[0].0, ticks(&second)[0].0), (0, 1));
}

mod arduino;
mod held;
mod json;
mod lockstep;
mod model;
mod robot_health;
mod ros2;
mod sensor_wire;
