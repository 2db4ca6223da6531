use super::{
    monitor::{Condition, Counts},
    *,
};
use common::{
    clock::{MissionTime, Pace},
    driver::Commander,
    mission::Response,
    samples::{CommandSample, HoldReason, Order, RangeReading, RangeStatus, Stamp},
};
use std::path::Path;

const MS: u64 = 1_000_000;
const LIMIT_MS: u64 = 250;
const SILENT_MS: u64 = 3 * LIMIT_MS;
const MOMENT_NS: u64 = 1;

fn mission() -> Mission {
    let text = "target = [3, 0]\nsensors = 'front'";
    Mission::parse(text, Path::new("test.toml")).unwrap()
}

fn ago(ns: u64) -> Moment {
    let machine_ns = 100_000 * MS - ns;
    Moment { time: MissionTime(machine_ns), machine_ns }
}

const fn now() -> Moment {
    Moment { time: MissionTime(100_000 * MS), machine_ns: 100_000 * MS }
}

fn command(tick_ago: u64, pose_ago: u64, guidance_ago: u64) -> CommandSample {
    let stamp_ns = ago(tick_ago).machine_ns;
    CommandSample {
        stamp: Stamp { stamp_ns, ..Stamp::default() },
        pose_ns: ago(pose_ago).machine_ns,
        guidance_ns: ago(guidance_ago).machine_ns,
        ..CommandSample::default()
    }
}

const fn boards(volts: f64) -> [f64; 3] {
    [volts, 0.0, 0.0]
}

fn front(status: RangeStatus, raw: u16) -> [RangeReading; 1] {
    let range_m = f64::from(raw) / 100.0;
    [RangeReading { range_m, status: status.into(), raw, ..RangeReading::default() }]
}

/// Returns a failsafe without any cause, all inputs at their age limit.
fn well() -> Failsafe {
    let mut failsafe = Failsafe::new(&mission());
    failsafe.monitors.presence.heard(now().machine_ns);
    let supervisor_silent = ago(orders::SUPERVISOR_SILENT.as_nanos() as u64);
    let limit = LIMIT_MS * MS;
    let frame = ago(SILENT_MS * MS - MOMENT_NS);
    for (what, when) in [
        (Observation::Pace(Pace::Rate(1.0)), now()),
        (Observation::Directive(Order::Drive, HoldReason::None), supervisor_silent),
        (Observation::Found { again: false }, frame),
        (Observation::Batteries(boards(7.2)), frame),
        (Observation::Readings(&front(RangeStatus::Nothing, 255)), frame),
        (Observation::Command(&command(limit, limit, limit)), now()),
    ] {
        failsafe.observe(&what, when);
    }
    failsafe
}

fn kobuki() -> Mission {
    let text = "target = [3, 0]\nrobot.model = 'kobuki'";
    Mission::parse(text, Path::new("m.toml")).unwrap()
}

type Break = fn(&mut Failsafe);

fn directive(failsafe: &mut Failsafe, order: Order, reason: HoldReason) {
    failsafe.observe(&Observation::Directive(order, reason), now());
}

fn jumps(failsafe: &mut Failsafe, when: Moment) {
    for _ in 0..3 {
        let jump = Observation::Motor([0; 2].into(), Counts::Implausible);
        failsafe.monitors.odometry.observe(&jump, when);
    }
}

fn frames(failsafe: &mut Failsafe, counts: impl IntoIterator<Item = u16>, first_ago_ms: u64) {
    for (frame, counts) in (0..).zip(counts) {
        let when = ago((first_ago_ms - 100 * frame) * MS);
        let motor = Observation::Motor([counts; 2].into(), Counts::Follow);
        failsafe.monitors.stop.observe(&motor, when);
    }
}

fn does_not_stop(failsafe: &mut Failsafe) {
    failsafe.observe(&Observation::Commanded([0, 0]), ago(5000 * MS));
    frames(failsafe, (1..=30).map(|frame| 50 * frame), 4000);
}

fn wheels_are_held(failsafe: &mut Failsafe) {
    for frame in (0..=10).rev() {
        let when = ago(100 * frame * MS);
        let odometry = &mut failsafe.monitors.odometry;
        odometry.observe(&Observation::Currents([1500; 2]), when);
        odometry.observe(&Observation::Motor([0; 2].into(), Counts::Follow), when);
        odometry.observe(&Observation::Commanded([1200; 2]), when);
    }
}

const fn commander(moves: bool) -> Commander {
    Commander { number: [0xab; 16], moves }
}

/// Omits infrared-1, which looks into the front sonar's cone.
fn without_an_infrared_ranger(failsafe: &mut Failsafe) {
    let mission = Mission::parse("target = [3, 0]", Path::new("test.toml")).unwrap();
    let status = RangeStatus::Nothing.into();
    let valid = |sensor| RangeReading { sensor, status, ..RangeReading::default() };
    let readings: Vec<_> = (0..10).filter(|sensor| *sensor != 4).map(valid).collect();
    let mut streams = streams::Streams::new(&mission);
    streams.observe(&Observation::Found { again: false }, now());
    streams.observe(&Observation::Readings(&readings), now());
    failsafe.monitors.streams = streams;
}

/// Sole change that leads to each cause, and its action.
const CASES: &[(Break, Action, Cause)] = &[
    (|it| directive(it, Order::Stop, HoldReason::Ending), Action::End, Cause::MissionOver),
    (
        |it| {
            for when in [ago(2000 * MS), now()] {
                it.observe(&Observation::Batteries(boards(5.9)), when);
            }
        },
        Action::End,
        Cause::BatteryEmpty,
    ),
    (|it| jumps(it, ago(10_000 * MS)), Action::End, Cause::OdometryGivenUp),
    (
        |it| it.observe(&Observation::Commander(commander(true)), now()),
        Action::Stop,
        Cause::AnotherCommander,
    ),
    (does_not_stop, Action::Stop, Cause::RobotDoesNotStop),
    (|it| directive(it, Order::Hold, HoldReason::Operator), Action::Stop, Cause::OperatorStop),
    (|it| directive(it, Order::Hold, HoldReason::StageHeld), Action::Stop, Cause::StageHeld),
    (|it| it.monitors.orders = Monitor::new(&mission()), Action::Stop, Cause::NotOrdered),
    (|it| directive(it, Order::Hold, HoldReason::Starting), Action::Stop, Cause::NotOrdered),
    (|it| directive(it, Order::Hold, HoldReason::None), Action::Stop, Cause::NotOrdered),
    (|it| directive(it, Order::Hold, HoldReason::Ending), Action::Stop, Cause::NotOrdered),
    (
        |it| {
            let silent = orders::SUPERVISOR_SILENT.as_nanos() as u64 + MOMENT_NS;
            let drive = Observation::Directive(Order::Drive, HoldReason::None);
            it.observe(&drive, ago(silent));
        },
        Action::Stop,
        Cause::SupervisorSilent,
    ),
    (
        |it| {
            it.monitors.presence.lose(now().machine_ns);
        },
        Action::Stop,
        Cause::RobotLost,
    ),
    (|it| it.observe(&Observation::Found { again: true }, now()), Action::Stop, Cause::RobotLate),
    (
        |it| {
            it.observe(&Observation::Found { again: false }, ago(SILENT_MS * MS));
        },
        Action::Stop,
        Cause::FramesSilent,
    ),
    (
        |it| {
            for frame in 0..10 {
                let motor = Observation::Motor([0; 2].into(), Counts::Follow);
                it.monitors.streams.observe(&motor, ago(300 * (9 - frame) * MS));
            }
        },
        Action::Stop,
        Cause::FramesSlow,
    ),
    (|it| jumps(it, now()), Action::Stop, Cause::OdometryImplausible),
    (wheels_are_held, Action::Stop, Cause::WheelsHeld),
    (
        |it| {
            it.monitors.touch = touch::Touches::new(&kobuki());
            it.monitors.touch.observe(&Observation::Commanded([100; 2]), now());
            it.observe(&Observation::Touched(&[(0, true)]), now());
        },
        Action::Stop,
        Cause::Felt,
    ),
    (
        |it| {
            let reading = front(RangeStatus::Nothing, 255);
            it.observe(&Observation::Readings(&reading), ago(SILENT_MS * MS));
            it.observe(&Observation::Readings(&front(RangeStatus::Invalid, 0)), now());
        },
        Action::Stop,
        Cause::RangeSilent,
    ),
    (
        |it| {
            for tick in 0..10 {
                let reading = front(RangeStatus::Measured, 100);
                it.monitors.range.observe(&Observation::Readings(&reading), now());
                let motor = Observation::Motor([200 * tick; 2].into(), Counts::Follow);
                it.monitors.range.observe(&motor, now());
            }
        },
        Action::Stop,
        Cause::RangeImplausible,
    ),
    (
        |it| {
            for tick in 0..10 {
                let reading = front(RangeStatus::Measured, 100 + 6 * (tick % 2));
                it.monitors.range.observe(&Observation::Readings(&reading), now());
                let motor = Observation::Motor([120 * tick; 2].into(), Counts::Follow);
                it.monitors.range.observe(&motor, now());
            }
        },
        Action::Slow,
        Cause::RangeDoubtful,
    ),
    (|it| it.monitors.staleness = fresh(None), Action::Stop, Cause::CommandStale),
    (
        |it| it.monitors.staleness = fresh(Some(command(LIMIT_MS * MS + MOMENT_NS, 0, 0))),
        Action::Stop,
        Cause::CommandStale,
    ),
    (
        |it| it.monitors.staleness = fresh(Some(command(0, LIMIT_MS * MS + MOMENT_NS, 0))),
        Action::Stop,
        Cause::PoseStale,
    ),
    (
        |it| it.monitors.staleness = fresh(Some(command(0, 0, LIMIT_MS * MS + MOMENT_NS))),
        Action::Stop,
        Cause::GuidanceStale,
    ),
    (without_an_infrared_ranger, Action::Slow, Cause::InfraredSilent),
    (
        |it| {
            let response = Response { delay_s: 0.3, ..Response::X80 };
            it.observe(&Observation::Responds(response), now());
        },
        Action::Slow,
        Cause::BaseSlow,
    ),
    (|it| it.observe(&Observation::Batteries(boards(6.5)), now()), Action::Slow, Cause::BatteryLow),
];

fn fresh(newest: Option<CommandSample>) -> staleness::Staleness {
    let mut staleness = staleness::Staleness::new(&mission());
    staleness.observe(&Observation::Pace(Pace::Rate(1.0)), now());
    if let Some(command) = newest {
        staleness.observe(&Observation::Command(&command), now());
    }
    staleness
}

fn broken(by: Break) -> Failsafe {
    let mut failsafe = well();
    by(&mut failsafe);
    failsafe
}

#[test]
fn where_nothing_is_wrong_commands_pass() {
    assert_eq!(well().decide(false, now()), Decision::GO);
}

#[test]
fn each_cause_alone_leads_to_its_action() {
    for &(by, action, cause) in CASES {
        assert_eq!(broken(by).decide(false, now()), Decision { action, cause });
    }
}

#[test]
fn every_cause_has_one_row_and_a_case_that_is_decided_otherwise_without_it() {
    for cause in (1..=u8::MAX).map(Cause::from_byte) {
        let rows = TABLE.iter().filter(|rule| rule.cause == cause).count();
        assert_eq!(rows, 1, "{cause:?}");
        let mut own = CASES.iter().filter(|(_, _, reported)| *reported == cause);
        let mut failsafe = broken(own.next().unwrap().0);
        let decision = failsafe.decide(false, now());
        let others = TABLE.iter().zip(failsafe.applied);
        let others = others.filter(|(rule, applied)| *applied && rule.cause != cause);
        assert_ne!(Decision::worst(others.map(|(rule, _)| rule)), decision);
    }
}

#[test]
fn whatever_is_wrong_at_once_nothing_milder_is_done_than_the_worst_of_it_asks_for() {
    for applying in 0..1_u32 << TABLE.len() {
        let rules = TABLE.iter().enumerate();
        let mut rules = rules.filter(|(row, _)| applying >> row & 1 == 1).map(|(_, rule)| rule);
        let decision = Decision::worst(rules.clone());
        let worst = rules.clone().map(|rule| rule.action).max();
        assert_eq!(decision.action, worst.unwrap_or(Action::Go));
        let reported = rules.find(|rule| Some(rule.action) == worst);
        assert_eq!(decision.cause, reported.map_or(Cause::None, |rule| rule.cause));
    }
}

#[test]
fn the_worst_actions_stand_first_in_the_table() {
    assert!(TABLE.is_sorted_by(|one, next| one.action >= next.action));
}

#[test]
fn in_lockstep_and_while_the_robot_is_away_its_frames_are_not_judged() {
    for by in [does_not_stop as Break, |it| jumps(it, now())] {
        assert_eq!(broken(by).decide(true, now()).action, Action::Go);
        let mut away = broken(by);
        away.monitors.presence.lose(now().machine_ns);
        assert_eq!(away.decide(false, now()).cause, Cause::RobotLost);
    }
    for &(by, action, cause) in CASES {
        let judges_frames = (rule(cause).unwrap().monitor)(&well().monitors).judges_frames();
        if !judges_frames && ![Cause::CommandStale, Cause::RobotLost].contains(&cause) {
            assert_eq!(broken(by).decide(true, now()), Decision { action, cause });
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
fn an_operators_resume_clears_what_its_row_says_and_an_end_stays() {
    let mut failsafe = broken(|it| jumps(it, ago(9000 * MS)));
    let implausible = failsafe.decide(false, now());
    assert_eq!(implausible.cause, Cause::OdometryImplausible);
    failsafe.observe(&Observation::Resumed, now());
    assert!(!failsafe.applied(Cause::OdometryImplausible));
    assert_eq!(failsafe.decide(false, now()), Decision::GO);
    let mut failsafe = broken(|it| jumps(it, ago(10_000 * MS)));
    assert_eq!(failsafe.decide(false, now()).action, Action::End);
    failsafe.observe(&Observation::Resumed, now());
    assert_eq!(failsafe.decide(false, now()).action, Action::End);
}

#[test]
fn a_robot_that_did_not_stop_goes_when_it_has_been_at_rest_for_half_a_second() {
    let mut failsafe = broken(does_not_stop);
    assert!(failsafe.decide(false, now()).stops());
    frames(&mut failsafe, [1500; 4], 1000);
    assert_eq!(failsafe.decide(false, now()).cause, Cause::RobotDoesNotStop);
    frames(&mut failsafe, [1500], 600);
    assert_eq!(failsafe.decide(false, now()), Decision::GO);
}

#[test]
fn the_words_of_the_table_say_the_numbers_that_hold() {
    let says = |cause: Cause, words: &str| {
        let rule = rule(cause).unwrap();
        assert!(rule.when.contains(words), "{words} in {rule:?}");
    };
    says(Cause::RobotLost, "three times");
    let robot = mission().robot;
    assert_eq!(robot.silent_after_s(), 3.0 * robot.command_limit_s);
    let seconds = |span: Duration| format!("{} s", span.as_secs_f64());
    says(Cause::SupervisorSilent, &seconds(orders::SUPERVISOR_SILENT));
    assert_eq!(common::topics::RESTATE * 5, Duration::from_secs(1));
    says(Cause::BatteryEmpty, &seconds(battery::EMPTY_AFTER));
    assert!((battery::EMPTY_SHARE - 10.0 / 11.0).abs() < 1e-9);
    says(Cause::BatteryLow, &format!("{} V", battery::RECOVERED_V));
    use odometry::{GIVEN_UP_AFTER, JUMPS_WITHIN, MOST_JUMPS, SUSPECTED_AFTER};
    says(Cause::OdometryGivenUp, &seconds(GIVEN_UP_AFTER));
    says(Cause::OdometryImplausible, &seconds(SUSPECTED_AFTER));
    let jumps = format!("{MOST_JUMPS} jumps within {}", seconds(JUMPS_WITHIN));
    says(Cause::OdometryImplausible, &jumps);
    let does_not_stop = seconds(stop_monitor::DOES_NOT_STOP_AFTER);
    says(Cause::RobotDoesNotStop, &does_not_stop);
    says(Cause::WheelsHeld, &seconds(contact::HELD_AFTER));
    says(Cause::WheelsHeld, &format!("stands for {}", seconds(contact::STANDS_FOR)));
    assert!(
        (Action::Slow.speed_share() - 0.5).abs() < 1e-9 && Action::Slow.effect().contains("half")
    );
}

#[test]
fn who_tells_the_robot_to_move_is_a_commander_at_once_and_until_a_second_without_a_word() {
    let mut failsafe = well();
    let silent = commander::GONE_AFTER.as_nanos() as u64;
    failsafe.observe(&Observation::Commander(commander(true)), ago(silent - MOMENT_NS));
    assert_eq!(failsafe.decide(false, now()).cause, Cause::AnotherCommander);
    let why = failsafe.explain(Cause::AnotherCommander, now()).unwrap();
    assert!(why.contains("cmd_vel") && why.contains(" ab.ab."), "{why}");
    let mut failsafe = well();
    failsafe.observe(&Observation::Commander(commander(true)), ago(silent));
    assert_eq!(failsafe.decide(false, now()), Decision::GO);
    // Commands after a pause do not continue those before it.
    failsafe.observe(&Observation::Commander(commander(false)), now());
    assert_eq!(failsafe.decide(false, now()), Decision::GO);
}

#[test]
fn who_tells_the_robot_only_to_stand_as_a_stop_guard_does_is_a_commander_after_2_s() {
    let stand = Observation::Commander(commander(false));
    let mut failsafe = well();
    for ms in [1999, 1200, 600, 0] {
        failsafe.observe(&stand, ago(ms * MS));
    }
    assert_eq!(failsafe.decide(false, now()), Decision::GO);
    let mut failsafe = well();
    for ms in [2000, 1200, 600, 0] {
        failsafe.observe(&stand, ago(ms * MS));
    }
    assert_eq!(failsafe.decide(false, now()).cause, Cause::AnotherCommander);
}

#[test]
fn a_slow_base_drives_at_half_speed_until_a_command_follows_from_what_was_found() {
    let late = Response { delay_s: 0.3, ..Response::X80 };
    let mut failsafe = well();
    failsafe.observe(&Observation::Responds(late), now());
    failsafe.observe(&Observation::Command(&command(0, MOMENT_NS, 0)), now());
    assert_eq!(failsafe.decide(false, now()).cause, Cause::BaseSlow);
    let told = failsafe.monitors.base.sample().unwrap();
    assert!(told.dead_time_s >= late.dead_time_s(), "{told:?}");
    failsafe.observe(&Observation::Command(&command(0, 0, 0)), now());
    assert_eq!(failsafe.decide(false, now()), Decision::GO);
    assert!(failsafe.monitors.base.sample().is_some(), "a restarted stage needs it");
    for set in ["method = 'paper'", "planner.executable = './mine'"] {
        let text = format!("target = [3, 0]\nsensors = 'front'\n{set}");
        let mission = Mission::parse(&text, Path::new("test.toml")).unwrap();
        let mut base = base_response::BaseResponse::new(&mission);
        base.observe(&Observation::Responds(late), now());
        base.observe(&Observation::Command(&command(0, 0, 0)), now());
        assert_eq!(base.condition(Cause::BaseSlow, now()), Condition::Holds, "{set}");
        assert_eq!(base.sample(), None, "{set}");
    }
}

#[test]
fn acknowledgements_of_what_was_not_sent_show_another_commander_and_late_or_doubled_ones_do_not() {
    // Each window ends with 50 commands; the robot acknowledges `count`.
    let after = |failsafe: &mut Failsafe, windows: std::ops::Range<u64>, count: usize| {
        let monitor = &mut failsafe.monitors.commander;
        for when in windows.map(|window| ago((20 - 2 * window) * 1000 * MS)) {
            monitor.observe(&Observation::Owed(50), when);
            (0..count).for_each(|_| monitor.observe(&Observation::Acknowledged, when));
            monitor.observe(&Observation::Time, when);
        }
        failsafe.decide(false, now()).cause
    };
    let mut failsafe = Failsafe::new(&mission());
    failsafe.monitors.presence.heard(now().machine_ns);
    let none = after(&mut failsafe, 0..3, 50 + commander::UNOWED - 1);
    assert_ne!(none, Cause::AnotherCommander, "a few came twice");
    assert_eq!(after(&mut failsafe, 3..4, 50 + commander::UNOWED), Cause::AnotherCommander);
    let why = failsafe.explain(Cause::AnotherCommander, now()).unwrap();
    assert!(why.contains("another host commands it"), "{why}");
    assert_ne!(after(&mut failsafe, 4..5, 50), Cause::AnotherCommander, "it has gone");
    failsafe.observe(&Observation::Pace(Pace::Max), now());
    assert_ne!(after(&mut failsafe, 5..6, 60), Cause::AnotherCommander, "it waits for commands");
}

#[test]
fn frames_that_go_elsewhere_while_acknowledgements_come_at_once_show_another_commander() {
    // After 6 undisturbed seconds, one frame in `every` comes, and one acknowledgement in
    // `answered`, after `late_ms`.
    let cause = |every: u64, late_ms: u64, answered: u64| {
        let mut monitor = commander::OtherCommander::new(&mission());
        for tick in 0..140_u64 {
            let at = ago((140 - tick) * 100 * MS);
            let is_disturbed = tick > 60;
            let mut take = |what: Observation<'_>, when: Moment| monitor.observe(&what, when);
            if !is_disturbed || tick % every == 0 {
                take(Observation::Motor([0; 2].into(), Counts::Follow), at);
            }
            take(Observation::Owed(1), at);
            if !is_disturbed || tick % answered == 0 {
                let late = if is_disturbed { late_ms } else { 0 };
                take(Observation::Acknowledged, ago((140 - tick) * 100 * MS - late * MS));
            }
            take(Observation::Time, at);
        }
        monitor.condition(Cause::AnotherCommander, now())
    };
    assert_eq!(cause(3, 5, 1), Condition::Holds);
    assert_eq!(cause(40, 5, 1), Condition::Holds, "it commands so often that it takes nearly all");
    let none = Condition::OverFor(Duration::MAX);
    assert_eq!(cause(1, 5, 1), none, "all is well");
    assert_eq!(cause(3, 5, 3), none, "the radio loses both");
    assert_eq!(cause(3, 90, 1), none, "the machine is busy");
    assert_eq!(cause(1000, 5, 1), none, "its motor frames have stopped");
}

#[test]
fn a_cause_that_the_log_explains_is_explained_by_what_was_seen_in_a_clause_without_an_end() {
    for &(by, _, cause) in CASES {
        let mut failsafe = broken(by);
        failsafe.decide(false, now());
        let explained = failsafe.explain(cause, now());
        // A slow base is explained once found.
        let is_promised =
            rule(cause).unwrap().when.contains("link.log") && cause != Cause::BaseSlow;
        assert!(!is_promised || explained.is_some(), "{cause:?}");
        let is_clause = |text: String| text.len() > 20 && !text.ends_with('.');
        assert!(explained.clone().is_none_or(is_clause), "{cause:?}: {explained:?}");
    }
}

#[test]
fn each_row_says_how_its_cause_ends() {
    let ends = |cause: Cause| rule(cause).unwrap().clears.to_string();
    assert_eq!(ends(Cause::CommandStale), "that is over");
    assert_eq!(ends(Cause::OdometryGivenUp), "the next mission");
    assert!(ends(Cause::RangeImplausible).contains("`resume`, or that has been over for"));
}
