use super::*;

use std::f64::consts::TAU;

use common::{
    samples::{RangeReading, Stamp},
    wire::{
        Addressing, COUNT_CYCLE, Command, CustomSensors, Decoder, MotorSensors, Report,
        StandardSensors, SystemSignal,
    },
};

use crate::testing::*;

const PERIOD_NS: u64 = 142_857_142;
const STAND: [Option<i16>; 2] = [Some(0); 2];
/// One turn per second, 1200 counts/s.
const TURN: f64 = TAU;
const PING: Command = Command::System(SystemSignal::Ping);
const FOUND: Effect = Effect::Connected(true);
const LOST: Effect = Effect::Connected(false);

/// X80: 1200 counts per turn, left wheel on channel 0, reversed, right wheel on channel 1.
fn x80() -> Mission {
    mission("sensors = 'front'")
}

fn started(mission: &Mission, pace: Pace, next_tick: u64) -> Link {
    let mut link = Link::new(mission);
    link.restore(State { pace, next_tick });
    link
}

fn in_ticks() -> Link {
    started(&x80(), Pace::Max, 0)
}

fn on_the_wall() -> Link {
    in_time(&x80())
}

fn in_time(mission: &Mission) -> Link {
    started(mission, Pace::Rate(1.0), 0)
}

/// Events at machine-clock readings, milliseconds; wall-clock missions begin at 0.
impl Link {
    fn at(&mut self, event: Event<'_>, ms: u64) -> Vec<Effect> {
        let machine_ns = ms * MS;
        let now = match self.state.pace {
            Pace::Max => self.state.next_tick * PERIOD_NS,
            Pace::Rate(_) => machine_ns,
        };
        self.step(Entry { event, machine_ns, now: MissionTime(now) })
    }

    fn quiet(&mut self, ms: u64) -> Vec<Effect> {
        self.at(Event::Quiet, ms)
    }

    fn hears(&mut self, bytes: &[u8], ms: u64) -> Vec<Effect> {
        self.at(Event::Datagram(bytes), ms)
    }

    /// Hears a robot at its start.
    fn still(&mut self, ms: u64) -> Vec<Effect> {
        self.hears(&datagram(255, [0; 2]), ms)
    }

    fn drive(&mut self, ms: u64) -> Vec<Effect> {
        self.at(Event::Order(Order::Drive, HoldReason::None), ms)
    }

    fn hold(&mut self, reason: HoldReason, ms: u64) -> Vec<Effect> {
        self.at(Event::Order(Order::Hold, reason), ms)
    }

    /// Takes a command, 1 ms after its tick of `ms`.
    fn told(&mut self, tick: u64, ms: u64, speeds: [f64; 2]) -> Vec<Effect> {
        self.at(Event::Command(command(tick, ms * MS, speeds)), ms + 1)
    }

    /// Answers a tick of lockstep.
    fn answer(&mut self, tick: u64, ms: u64) -> Vec<Effect> {
        self.at(Event::Command(command(tick, tick * PERIOD_NS, [TURN; 2])), ms)
    }
}

fn encoded(reports: impl IntoIterator<Item = Report>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for report in reports {
        report.encode(Addressing::default(), &mut bytes);
    }
    bytes
}

fn motor(channels: [u16; 2]) -> Report {
    let mut motor = MotorSensors::default();
    for (encoder, position) in motor.encoders.iter_mut().zip(channels) {
        encoder.position = position;
    }
    Report::Motor(motor)
}

fn standard(sonar: u8) -> StandardSensors {
    let mut standard = StandardSensors::default();
    standard.ultrasonic[1] = sonar;
    standard
}

fn datagram(sonar: u8, channels: [u16; 2]) -> Vec<u8> {
    encoded([Report::Standard(standard(sonar)), motor(channels)])
}

/// Frames of a robot that rolled ahead by `counts`.
fn rolled(counts: u16) -> Vec<u8> {
    datagram(255, [(COUNT_CYCLE - counts) % COUNT_CYCLE, counts])
}

fn ack() -> Vec<u8> {
    encoded([Report::System(SystemSignal::Ack)])
}

fn command(tick: u64, time_ns: u64, [left_rad_s, right_rad_s]: [f64; 2]) -> CommandSample {
    CommandSample {
        stamp: Stamp { tick, stamp_ns: time_ns, ..Stamp::default() },
        pose_ns: time_ns,
        guidance_ns: time_ns,
        left_rad_s,
        right_rad_s,
        state: CommandState::Driving.into(),
        ..CommandSample::default()
    }
}

fn driving(mut link: Link) -> Link {
    link.still(0);
    link.drive(0);
    link
}

/// Returns a link whose tick 0 began at 10 ms.
fn ticking() -> Link {
    let mut link = driving(on_the_wall());
    link.still(10);
    link
}

fn sent(effects: &[Effect]) -> Vec<Command> {
    let mut decoder = Decoder::default();
    for effect in effects {
        if let Effect::Send(bytes) = effect {
            decoder.push(bytes);
        }
    }
    let parsed = || Some(Command::parse(&decoder.next_frame()?).unwrap());
    std::iter::from_fn(parsed).collect()
}

/// Returns targets and time limits of velocity commands.
fn timed(effects: &[Effect]) -> Vec<([Option<i16>; 2], Option<u16>)> {
    let motion = |command: Command| match command {
        Command::Motion(motion) => {
            Some(([0, 1].map(|wheel| motion.targets.of(wheel)), motion.limit_ms))
        }
        _ => None,
    };
    sent(effects).into_iter().filter_map(motion).collect()
}

fn velocities(effects: &[Effect]) -> Vec<[Option<i16>; 2]> {
    timed(effects).into_iter().map(|(velocity, _)| velocity).collect()
}

fn stands(effects: &[Effect]) -> bool {
    velocities(effects).iter().all(|velocity| *velocity == STAND)
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
fn what_came_during_a_pause_of_the_link_is_known_to_have_waited_until_its_turn_ends() {
    let mut link = on_the_wall();
    for (event, ms, waited) in [
        (Event::Quiet, 0, false),
        (Event::Datagram(b"{}"), 90, false),
        (Event::Datagram(b"{}"), 300, true),
        (Event::Datagram(b"{}"), 300, true),
        (Event::Quiet, 300, false),
        (Event::Datagram(b"{}"), 320, false),
    ] {
        link.at(event, ms);
        assert_eq!(link.moment().is_after_pause, waited, "{event:?} at {ms} ms");
    }
}

#[test]
fn a_link_pings_until_the_robot_answers_sets_it_up_and_tells_it_to_stand_until_a_command_comes() {
    let mut link = on_the_wall();
    // A silent robot may still receive.
    for (ms, count) in [(0, 1 + STOPS as usize), (100, 0), (200, 2)] {
        let sent = sent(&link.quiet(ms));
        assert!(sent.len() == count && sent.first().is_none_or(|it| *it == PING), "{ms}: {sent:?}");
    }
    let effects = link.still(201);
    assert!(effects.contains(&FOUND));
    assert_eq!(sent(&effects).len(), 9 + STOPS as usize, "{effects:?}");
    // The previous link was killed, and the robot ignores its last command's limit.
    assert_eq!(velocities(&effects), [STAND; STOPS as usize]);
    assert!(velocities(&link.drive(202)).is_empty());
    let effects = link.quiet(402);
    assert!(!sent(&effects).contains(&PING));
    assert_eq!(velocities(&effects), [STAND]);
}

#[test]
fn a_wire_that_goes_down_is_a_robot_lost_and_nothing_is_sent_until_it_is_back() {
    let mut link = driving(on_the_wall());
    link.hears(&datagram(80, [0; 2])[..20], 10);
    assert!(link.at(Event::Wire(false), 11).contains(&LOST));
    assert_eq!(link.quiet(1000), []);
    let effects = link.at(Event::Wire(true), 1001);
    assert_eq!(sent(&effects)[0], PING);
    assert_eq!(velocities(&effects), [STAND; STOPS as usize]);
    let effects = link.hears(&datagram(80, [0; 2]), 1002);
    assert!(effects.contains(&FOUND) && ticks(&effects)[0].1[0].raw == 80, "{effects:?}");
}

#[test]
fn a_robot_that_stays_away_is_pinged_ever_less_often_and_heard_at_once() {
    let mut link = on_the_wall();
    let is_pinged = |now: &u64| sent(&link.quiet(*now)).contains(&PING);
    let pings = Vec::from_iter((0..8000).step_by(20).filter(is_pinged));
    assert_eq!(pings, [0, 200, 600, 1400, 3000, 5000, 7000]);
    let expected = Absence { lost_ns: 7900 * MS, pings: 7, next_ping_ns: 1100 * MS };
    assert_eq!(link.absence(7900 * MS), expected);
    assert!(link.still(7950).contains(&FOUND));
    assert_eq!(link.absence(7960 * MS), Absence::default());
    // A robot lost again is pinged at once and often.
    let effects = link.quiet(8700);
    assert!(effects.contains(&LOST) && sent(&effects).contains(&PING));
    assert!(sent(&link.quiet(8900)).contains(&PING));
    link.still(8950);
    assert_eq!((link.losses(), link.restarts()), (1, 0));
}

#[test]
fn a_robot_that_restarted_its_counts_is_noticed_and_set_up_again() {
    for (counts, restarts) in [(0, 1), (468, 0)] {
        let mut link = driving(on_the_wall());
        assert_eq!(ticks(&link.hears(&rolled(400), 10))[0].2.restarts, 0);
        let effects = link.quiet(1000);
        assert!(effects.contains(&LOST) && sent(&effects).contains(&PING));
        let effects = link.hears(&rolled(counts), 3000);
        let found = [FOUND, Effect::Restarted].map(|effect| effects.contains(&effect));
        assert_eq!(found, [true, restarts == 1], "{counts}");
        // The mission goes on with the next tick.
        let (tick, _, wheels) = ticks(&effects)[0];
        assert_eq!((tick, wheels.restarts, link.restarts()), (1, restarts, restarts));
    }
    // The same after an unnoticed absence.
    let mut link = driving(on_the_wall());
    link.hears(&rolled(1600), 500);
    let effects = link.still(600);
    assert!(effects.contains(&Effect::Restarted));
    assert!(effects.contains(&Effect::Send(link.base.greeting())));
}

#[test]
fn a_command_is_sent_in_counts_and_again_once_halfway_to_the_next_tick_with_what_remains_of_its_time()
 {
    let mut link = ticking();
    let sent = |limit_ms: u16| [([Some(-1200), Some(600)], Some(limit_ms))];
    let effects = link.told(0, 10, [TURN, TURN / 2.0]);
    assert_eq!(timed(&effects), sent(250));
    assert!(effects.contains(&Effect::Answered { began_ns: 10 * MS }));
    // Repeated half of 142.9 ms after the tick.
    assert_eq!(timed(&link.quiet(81)), []);
    assert_eq!(timed(&link.quiet(90)), sent(170));
    assert_eq!(timed(&link.quiet(140)), [], "once");
    assert_eq!((link.tally.commands_out, link.tally.repeated_commands), (1, 1));
}

#[test]
fn a_command_that_no_longer_holds_or_whose_successor_is_due_is_not_sent_again() {
    for (event, at) in [
        (Event::Order(Order::Hold, HoldReason::Operator), 20),
        (Event::Wire(false), 20),
        (Event::Quiet, 270),
        (Event::Datagram(&rolled(0)), 75),
    ] {
        let mut link = ticking();
        link.told(0, 10, [1.0; 2]);
        link.at(event, at);
        assert!(stands(&link.quiet(at + 70)), "{event:?}");
    }
}

#[test]
fn what_a_frame_carries_besides_the_tick_is_told_even_while_nothing_drives() {
    let custom = Report::Custom(CustomSensors::default());
    let effects = on_the_wall().hears(&[rolled(0), encoded([custom])].concat(), 0);
    let told = |effect: &&Effect| {
        matches!(effect, Effect::Infrared(_) | Effect::Power(_) | Effect::Surroundings(_))
    };
    assert_eq!((effects.iter().filter(told).count(), ticks(&effects).len()), (3, 0), "{effects:?}");
}

#[test]
fn a_link_that_stops_its_robot_looks_again_soon() {
    let link = on_the_wall();
    assert!(!link.is_calm_until(link.moment()));
}

#[test]
fn a_command_that_is_older_than_the_newest_or_from_the_future_moves_nothing() {
    let future = Event::Command(command(0, 900 * MS, [1.0; 2]));
    assert!(stands(&ticking().at(future, 11)));
    let mut link = ticking();
    assert_eq!(ticks(&link.still(150))[0].0, 1, "after an abandoned tick");
    link.told(1, 150, [1.0; 2]);
    let old = Event::Command(command(0, 10 * MS, [-1.0; 2]));
    assert_eq!(link.at(old, 152), []);
}

#[test]
fn a_stale_command_stops_the_robot_three_times_and_keeps_telling() {
    let mut link = ticking();
    link.told(0, 10, [1.0; 2]);
    assert_eq!(velocities(&link.quiet(200)).len(), 1, "the command once more");
    assert_eq!(link.quiet(260), [], "not yet over 250 ms");
    let effects = link.quiet(261);
    assert_eq!(velocities(&effects), [STAND; 3]);
    assert_eq!(decided(&effects), [(Action::Stop, Cause::CommandStale)]);
    assert_eq!(link.quiet(262), [], "said");
    assert_eq!(velocities(&link.quiet(462)), [STAND]);
}

#[test]
fn a_robot_that_another_host_commands_is_told_to_stand_after_each_acknowledgement_of_its_commands()
{
    let mut link = driving(on_the_wall());
    let mut first_ms = None;
    // The robot, found at 0 s, acknowledges another host's commands too from 5 s on.
    for tick in 0..100 {
        let ms = 100 * (tick + 1);
        let own = [link.still(ms), link.drive(ms), link.told(tick, ms, [0.0; 2])].concat();
        let mut owed = sent(&own).len();
        for is_other in [false, true] {
            if is_other && ms >= 5000 {
                let stops = link.decision.cause == Cause::AnotherCommander;
                let effects = link.hears(&ack(), ms + 1);
                assert!(!stops || !velocities(&effects).is_empty(), "it obeys the newest command");
                owed = sent(&effects).len();
            }
            for _ in 0..std::mem::take(&mut owed) {
                link.hears(&ack(), ms + 1);
            }
            if link.decision.cause == Cause::AnotherCommander {
                first_ms.get_or_insert(ms);
            }
        }
    }
    assert!(first_ms.is_some_and(|ms| ms >= 5000), "{first_ms:?}");
}

mod arduino;
mod held;
mod json;
mod lockstep;
mod model;
mod robot_health;
mod ros2;
mod sensor_wire;
