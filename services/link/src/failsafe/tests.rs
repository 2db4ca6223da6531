use super::{
    monitor::{Condition, Counts},
    *,
};
use crate::testing::*;
use common::{
    clock::{MissionTime, Pace},
    driver::{Commander, counts::WheelCounts},
    mission::Response,
    samples::{CommandSample, HoldReason, Order, RangeReading, RangeStatus, Stamp},
};

use Observation::*;

const LIMIT_MS: u64 = 250;
const SILENT_MS: u64 = 3 * LIMIT_MS;
/// Just over the age limit of inputs, nanoseconds.
const STALE: u64 = LIMIT_MS * MS + 1;
const LATE: Response = Response { delay_s: 0.3, ..Response::X80 };
const DRIVE: Observation<'_> = Directive(Order::Drive, HoldReason::None);
const FOUND: Observation<'_> = Found { again: false };

fn front_only() -> Mission {
    mission("sensors = 'front'")
}

const fn ago(ns: u64) -> Moment {
    let machine_ns = 100_000 * MS - ns;
    Moment { time: MissionTime(machine_ns), machine_ns, is_after_pause: false }
}

const fn now() -> Moment {
    ago(0)
}

const fn boards(volts: f64) -> Observation<'static> {
    Batteries([volts, 0.0, 0.0])
}

const fn counts(counts: u16) -> Observation<'static> {
    Motor(WheelCounts::Cyclic([counts; 2]), Counts::Follow)
}

impl Failsafe {
    fn sees(&mut self, what: Observation<'_>, ms_ago: u64) {
        self.observe(&what, ago(ms_ago * MS));
    }

    fn is_held(&mut self, reason: HoldReason) {
        self.sees(Directive(Order::Hold, reason), 0);
    }

    fn takes_command(&mut self, ns_ago: [u64; 3]) {
        let [stamp_ns, pose_ns, guidance_ns] = ns_ago.map(|ns| ago(ns).machine_ns);
        let stamp = Stamp { stamp_ns, ..Stamp::default() };
        let command = CommandSample { stamp, pose_ns, guidance_ns, ..CommandSample::default() };
        self.sees(Command(&command), 0);
    }

    fn loses_the_robot(&mut self) {
        self.presence.lose(now().machine_ns);
    }

    fn jumps(&mut self, ms_ago: u64) {
        for _ in 0..3 {
            let jump = Motor([0; 2].into(), Counts::Implausible);
            self.odometry.observe(&jump, ago(ms_ago * MS));
        }
    }

    fn does_not_stop(&mut self) {
        self.sees(Commanded([0, 0]), 5000);
        for frame in 1..=30_u16 {
            let when = ago(u64::from(4100 - 100 * frame) * MS);
            self.stop.observe(&counts(50 * frame), when);
        }
    }

    /// Drives with these front ranges and wheel counts in each of ten ticks.
    fn ranges(&mut self, range_cm: impl Fn(u16) -> u16, counts_per_tick: u16) {
        for tick in 0..10 {
            let reading = [reading(0, Some(f64::from(range_cm(tick)) / 100.0))];
            for what in [Readings(&reading), counts(counts_per_tick * tick)] {
                self.range.observe(&what, now());
            }
        }
    }

    fn decides(&mut self) -> Decision {
        self.decide(false, now())
    }

    fn cause(&mut self) -> Cause {
        self.decides().cause
    }
}

/// Returns a failsafe without any cause, all inputs at their age limit.
fn well() -> Failsafe {
    let mut failsafe = Failsafe::new(&front_only());
    failsafe.presence.heard(now().machine_ns);
    failsafe.sees(Pace(Pace::Rate(1.0)), 0);
    failsafe.observe(&DRIVE, ago(orders::SUPERVISOR_SILENT.as_nanos() as u64));
    for what in [FOUND, boards(7.2), Readings(&[reading(0, None)])] {
        failsafe.observe(&what, ago(SILENT_MS * MS - 1));
    }
    failsafe.takes_command([LIMIT_MS * MS; 3]);
    failsafe
}

type Break = fn(&mut Failsafe);

fn wheels_are_held(failsafe: &mut Failsafe) {
    for frame in (0..=10).rev() {
        let odometry = &mut failsafe.odometry;
        for what in [Currents([1500; 2]), counts(0), Commanded([1200; 2])] {
            odometry.observe(&what, ago(100 * frame * MS));
        }
    }
}

const fn commander(moves: bool) -> Observation<'static> {
    Commander(Commander { number: [0xab; 16], moves })
}

/// Omits infrared-1, which looks into the front sonar's cone.
fn without_an_infrared_ranger(failsafe: &mut Failsafe) {
    let readings = [0, 1, 2, 3, 5, 6, 7, 8, 9].map(|sensor| reading(sensor, None));
    failsafe.streams = Monitor::new(&mission(""));
    failsafe.sees(FOUND, 0);
    failsafe.sees(Readings(&readings), 0);
}

/// Sole change that leads to each cause.
const CASES: &[(Break, Cause)] = &[
    (|it| it.sees(Directive(Order::Stop, HoldReason::Ending), 0), Cause::MissionOver),
    (|it| [2000, 0].into_iter().for_each(|ms| it.sees(boards(5.9), ms)), Cause::BatteryEmpty),
    (|it| it.jumps(10_000), Cause::OdometryGivenUp),
    (|it| it.sees(commander(true), 0), Cause::AnotherCommander),
    (Failsafe::does_not_stop, Cause::RobotDoesNotStop),
    (|it| it.is_held(HoldReason::Operator), Cause::OperatorStop),
    (|it| it.is_held(HoldReason::StageHeld), Cause::StageHeld),
    (|it| it.orders = Monitor::new(&front_only()), Cause::NotOrdered),
    (|it| it.is_held(HoldReason::None), Cause::NotOrdered),
    (
        |it| it.observe(&DRIVE, ago(orders::SUPERVISOR_SILENT.as_nanos() as u64 + 1)),
        Cause::SupervisorSilent,
    ),
    (Failsafe::loses_the_robot, Cause::RobotLost),
    (|it| it.sees(Found { again: true }, 0), Cause::RobotLate),
    (|it| it.sees(FOUND, SILENT_MS), Cause::FramesSilent),
    (
        |it| {
            for frame in (0..10).rev() {
                it.streams.observe(&counts(0), ago(300 * frame * MS));
            }
        },
        Cause::FramesSlow,
    ),
    (|it| it.jumps(0), Cause::OdometryImplausible),
    (wheels_are_held, Cause::WheelsHeld),
    (
        |it| {
            it.touch = Monitor::new(&mission("robot.model = 'kobuki'"));
            it.touch.observe(&Commanded([100; 2]), now());
            it.sees(Touched(&[(0, true)]), 0);
        },
        Cause::Felt,
    ),
    (
        |it| {
            it.sees(Readings(&[reading(0, None)]), SILENT_MS);
            let status = RangeStatus::Invalid.into();
            it.sees(Readings(&[RangeReading { status, ..reading(0, None) }]), 0);
        },
        Cause::RangeSilent,
    ),
    (|it| it.ranges(|_| 100, 200), Cause::RangeImplausible),
    (|it| it.ranges(|tick| 100 + 6 * (tick % 2), 120), Cause::RangeDoubtful),
    (|it| it.staleness = Monitor::new(&front_only()), Cause::CommandStale),
    (|it| it.takes_command([STALE, 0, 0]), Cause::CommandStale),
    (|it| it.takes_command([0, STALE, 0]), Cause::PoseStale),
    (|it| it.takes_command([0, now().machine_ns, 0]), Cause::PoseStale),
    (|it| it.takes_command([0, 0, STALE]), Cause::GuidanceStale),
    (without_an_infrared_ranger, Cause::InfraredSilent),
    (|it| it.sees(Responds(LATE), 0), Cause::BaseSlow),
    (|it| it.sees(boards(6.5), 0), Cause::BatteryLow),
];

/// Returns the action for a cause.
fn action(cause: Cause) -> Action {
    match cause {
        Cause::MissionOver | Cause::BatteryEmpty | Cause::OdometryGivenUp => Action::End,
        Cause::RangeDoubtful | Cause::InfraredSilent | Cause::BaseSlow | Cause::BatteryLow => {
            Action::Slow
        }
        _ => Action::Stop,
    }
}

fn broken(by: Break) -> Failsafe {
    let mut failsafe = well();
    by(&mut failsafe);
    failsafe
}

#[test]
fn each_cause_alone_leads_to_its_action_and_is_explained_by_what_was_seen_in_a_clause_without_an_end()
 {
    assert_eq!(well().decides(), Decision::GO);
    for &(by, cause) in CASES {
        let mut failsafe = broken(by);
        assert_eq!(failsafe.decides(), Decision { action: action(cause), cause });
        let explained = failsafe.explain(cause, now());
        // A slow base is explained once found.
        let is_promised =
            rule(cause).unwrap().when.contains("link.log") && cause != Cause::BaseSlow;
        assert!(!is_promised || explained.is_some(), "{cause:?}");
        let is_clause = |text: &String| text.len() > 20 && !text.ends_with('.');
        assert!(explained.as_ref().is_none_or(is_clause), "{cause:?}: {explained:?}");
    }
}

#[test]
fn every_cause_has_one_row_and_a_case_that_is_decided_otherwise_without_it() {
    for cause in (1..=u8::MAX).map(Cause::from_byte) {
        let rows = TABLE.iter().filter(|rule| rule.cause == cause).count();
        assert_eq!(rows, 1, "{cause:?}");
        let (by, _) = CASES.iter().find(|(_, reported)| *reported == cause).unwrap();
        let mut failsafe = broken(*by);
        let decision = failsafe.decides();
        let others = TABLE.iter().filter(|it| it.cause != cause && failsafe.applied(it.cause));
        assert_ne!(Decision::worst(others), decision);
    }
}

#[test]
fn whatever_is_wrong_at_once_nothing_milder_is_done_than_the_worst_of_it_asks_for() {
    // The worst come first.
    for (row, worst) in TABLE.iter().enumerate() {
        for other in &TABLE[row..] {
            let Rule { action, cause, .. } = *worst;
            assert_eq!(Decision::worst([worst, other]), Decision { action, cause });
        }
    }
}

#[test]
fn in_lockstep_and_while_the_robot_is_away_its_frames_are_not_judged() {
    for by in [Failsafe::does_not_stop as Break, |it| it.jumps(0)] {
        assert_eq!(broken(by).decide(true, now()).action, Action::Go);
        let mut away = broken(by);
        away.loses_the_robot();
        assert_eq!(away.cause(), Cause::RobotLost);
    }
    for &(by, cause) in CASES {
        let judges_frames = (rule(cause).unwrap().monitor)(&well()).judges_frames();
        if !judges_frames && ![Cause::CommandStale, Cause::RobotLost].contains(&cause) {
            assert_eq!(broken(by).decide(true, now()).cause, cause);
        }
    }
}

#[test]
fn a_cause_applies_no_longer_when_its_row_says_so() {
    let over = |ms| Condition::OverFor(Duration::from_millis(ms));
    let second = Duration::from_secs(1);
    let resume = |or_after| Clears::OnResume { or_after };
    for (clears, after_999_ms, after_1_s) in [
        (Clears::WithCondition, false, false),
        (Clears::After(second), true, false),
        (resume(Some(second)), true, false),
        (resume(None), true, true),
        (Clears::OnNewMission, true, true),
    ] {
        assert_eq!(clears.applies(true, over(999)), after_999_ms, "{clears:?}");
        assert_eq!(clears.applies(true, over(1000)), after_1_s, "{clears:?}");
        assert!(!clears.applies(false, over(0)), "{clears:?}");
        for before in [true, false] {
            assert!(clears.applies(before, Condition::Holds), "{clears:?}");
        }
    }
}

#[test]
fn an_operators_resume_clears_at_once_what_its_row_says_and_an_end_stays() {
    let mut failsafe = broken(|it| it.jumps(9000));
    assert_eq!(failsafe.cause(), Cause::OdometryImplausible);
    failsafe.sees(Resumed, 0);
    assert!(!failsafe.applied(Cause::OdometryImplausible));
    let mut failsafe = broken(|it| it.jumps(10_000));
    for _ in 0..2 {
        assert_eq!(failsafe.cause(), Cause::OdometryGivenUp);
        failsafe.sees(Resumed, 0);
    }
}

#[test]
fn the_words_of_the_table_say_the_numbers_that_hold() {
    use odometry::{GIVEN_UP_AFTER, JUMPS_WITHIN, MOST_JUMPS, SUSPECTED_AFTER_S};
    let seconds = |span: Duration| format!("{} s", span.as_secs_f64());
    for (cause, words) in [
        (Cause::BatteryLow, format!("{} V", battery::RECOVERED_V)),
        (Cause::SupervisorSilent, seconds(orders::SUPERVISOR_SILENT)),
        (Cause::BatteryEmpty, seconds(battery::EMPTY_AFTER)),
        (Cause::OdometryGivenUp, seconds(GIVEN_UP_AFTER)),
        (Cause::OdometryImplausible, format!("{SUSPECTED_AFTER_S} s")),
        (
            Cause::OdometryImplausible,
            format!("{MOST_JUMPS} jumps within {}", seconds(JUMPS_WITHIN)),
        ),
        (Cause::RobotDoesNotStop, seconds(stop_monitor::DOES_NOT_STOP_AFTER)),
        (Cause::WheelsHeld, format!("{} s", contact::HELD_AFTER_S)),
        (Cause::WheelsHeld, format!("stands for {}", seconds(contact::STANDS_FOR))),
        (Cause::RobotLost, "three times".to_owned()),
    ] {
        let rule = rule(cause).unwrap();
        assert!(rule.when.contains(&words), "{words} in {rule:?}");
    }
    let robot = front_only().robot;
    assert_eq!(robot.silent_after_s(), 3.0 * robot.command_limit_s);
    near(battery::EMPTY_SHARE, 10.0 / 11.0, 1e-9);
    near(Action::Slow.speed_share(), 0.5, 1e-9);
    assert!(Action::Slow.effect().contains("half"));
    for (cause, ends) in [
        (Cause::CommandStale, "that is over"),
        (Cause::RobotDoesNotStop, "over for 0.5 s"),
        (Cause::OdometryGivenUp, "the next mission"),
        (Cause::RangeImplausible, "`resume`, or that has been over for"),
    ] {
        assert!(rule(cause).unwrap().clears.to_string().contains(ends), "{cause:?}");
    }
}

#[test]
fn who_tells_the_robot_to_move_is_a_commander_at_once_and_who_tells_it_to_stand_after_2_s() {
    let mut failsafe = well();
    failsafe.sees(commander(true), 999);
    assert_eq!(failsafe.cause(), Cause::AnotherCommander);
    let why = failsafe.explain(Cause::AnotherCommander, now()).unwrap();
    assert!(why.contains("cmd_vel") && why.contains(" ab.ab."), "{why}");
    let mut failsafe = well();
    failsafe.observe(&commander(true), ago(commander::GONE_AFTER.as_nanos() as u64));
    assert_eq!(failsafe.decides(), Decision::GO);
    // Commands after a pause do not continue those before it.
    failsafe.sees(commander(false), 0);
    assert_eq!(failsafe.decides(), Decision::GO);
    // A stop guard only tells it to stand.
    for (first_ms, cause) in [(1999, Cause::None), (2000, Cause::AnotherCommander)] {
        let mut failsafe = well();
        for ms in [first_ms, 1200, 600, 0] {
            failsafe.sees(commander(false), ms);
        }
        assert_eq!(failsafe.cause(), cause, "{first_ms}");
    }
}

#[test]
fn a_slow_base_drives_at_half_speed_until_a_command_follows_from_what_was_found() {
    let mut failsafe = well();
    failsafe.sees(Responds(LATE), 0);
    failsafe.takes_command([0, 1, 0]);
    assert_eq!(failsafe.cause(), Cause::BaseSlow);
    let told = failsafe.base.sample().unwrap();
    assert!(told.dead_time_s >= LATE.dead_time_s(), "{told:?}");
    failsafe.takes_command([0; 3]);
    assert_eq!(failsafe.decides(), Decision::GO);
    assert!(failsafe.base.sample().is_some(), "a restarted stage needs it");
    for set in ["method = 'paper'", "planner.executable = './mine'"] {
        let mut failsafe = well();
        failsafe.base = Monitor::new(&mission(set));
        failsafe.sees(Responds(LATE), 0);
        failsafe.takes_command([0; 3]);
        assert_eq!((failsafe.cause(), failsafe.base.sample()), (Cause::BaseSlow, None), "{set}");
    }
}

#[test]
fn acknowledgements_of_what_was_not_sent_show_another_commander_and_late_or_doubled_ones_do_not() {
    // Each window ends with 50 commands; the robot acknowledges `count`.
    let after = |failsafe: &mut Failsafe, windows: std::ops::Range<u64>, count: usize| {
        let monitor = &mut failsafe.commander;
        for when in windows.map(|window| ago((20 - 2 * window) * 1000 * MS)) {
            monitor.observe(&Sent(50), when);
            (0..count).for_each(|_| monitor.observe(&Acknowledged, when));
            monitor.observe(&Time, when);
        }
        failsafe.cause()
    };
    let mut failsafe = Failsafe::new(&front_only());
    failsafe.presence.heard(now().machine_ns);
    let none = after(&mut failsafe, 0..3, 50 + commander::UNOWED - 1);
    assert_ne!(none, Cause::AnotherCommander, "a few came twice");
    assert_eq!(after(&mut failsafe, 3..4, 50 + commander::UNOWED), Cause::AnotherCommander);
    let why = failsafe.explain(Cause::AnotherCommander, now()).unwrap();
    assert!(why.contains("another program commands it"), "{why}");
    assert_ne!(after(&mut failsafe, 4..5, 50), Cause::AnotherCommander, "it has gone");
    failsafe.sees(Pace(Pace::Max), 0);
    assert_ne!(after(&mut failsafe, 5..6, 60), Cause::AnotherCommander, "it waits for commands");
}

#[test]
fn frames_that_go_elsewhere_while_acknowledgements_come_at_once_show_another_commander() {
    // After 6 undisturbed seconds, one frame in `every` comes, and one acknowledgement in
    // `answered`, after `late_ms`.
    for (disturbed, is_found, why) in [
        ([3, 5, 1], true, "it takes frames"),
        ([40, 5, 1], true, "it commands so often that it takes nearly all"),
        ([1, 5, 1], false, "all is well"),
        ([3, 5, 3], false, "the radio loses both"),
        ([3, 90, 1], false, "the machine is busy"),
        ([1000, 5, 1], false, "its motor frames have stopped"),
    ] {
        let mut monitor = commander::OtherCommander::new(&front_only());
        for tick in 0..140 {
            let ms_ago = (140 - tick) * 100;
            let [every, late_ms, answered] = if tick > 60 { disturbed } else { [1, 0, 1] };
            let mut take = |what: Observation<'_>, ms_ago: u64| {
                monitor.observe(&what, ago(ms_ago * MS));
            };
            if tick % every == 0 {
                take(counts(0), ms_ago);
            }
            take(Sent(1), ms_ago);
            if tick % answered == 0 {
                take(Acknowledged, ms_ago - late_ms);
            }
            take(Time, ms_ago);
        }
        let condition = monitor.condition(Cause::AnotherCommander, now());
        assert_eq!(condition == Condition::Holds, is_found, "{why}");
    }
}
