use super::*;
use common::samples::Cause;

fn link(action: Action, cause: Cause) -> LinkSample {
    LinkSample { connected: 1, action: action.into(), cause: cause.into(), ..LinkSample::default() }
}

const fn deadline(timeout_s: f64, stopped_s: f64) -> Deadline {
    Deadline { began_s: 0.0, timeout_s, stopped_s }
}

#[test]
fn the_time_of_an_operators_stop_is_counted_from_its_first_sight_to_its_last() {
    let mut clock = StopClock::default();
    let at = MissionTime::from_seconds;
    let looks = [(3.0, false), (4.0, true), (6.0, true), (9.0, false), (12.0, false)];
    let passed = looks.map(|(seconds, stopped)| clock.passed_s(stopped, at(seconds)));
    assert_eq!(passed, [0.0, 0.0, 2.0, 3.0, 0.0]);
}

#[test]
fn every_rule_of_the_judgement_decides_its_row() {
    let start = Duration::from_secs(100);
    let go = link(Action::Go, Cause::None);
    let stop = link(Action::Stop, Cause::BatteryLow);
    let end = link(Action::End, Cause::BatteryEmpty);
    let away = LinkSample { connected: 0, ..go };
    let robot = "x80".parse().unwrap();
    let address = "udp://10.0.0.1:10001".parse::<Address<String>>().unwrap().resolve().unwrap();
    let moving = LinkSample { at_rest: 0, ..go };
    let resting = LinkSample { at_rest: 1, ..go };
    let arrival = |distance_m, seconds| {
        Some(Arrival { distance_m, beside: None, since: start + Duration::from_secs(seconds) })
    };
    let beside = arrival(0.36, 0).map(|it| Arrival { beside: Some(DVec2::new(2.64, 0.0)), ..it });
    let driving = || Snapshot {
        arrival: None,
        link: Some(&go),
        may_be_away: false,
        simulator_ended: false,
        collision_m: None,
        time: MissionTime::from_seconds(10.0),
        deadline: deadline(60.0, 0.0),
        in_ticks: true,
        progress: start,
        has_ticked: true,
        complaint: None,
        reason: HoldReason::None,
        held: Vec::new(),
        not_started: Vec::new(),
        not_ready: Vec::new(),
        robot: &robot,
        address: &address,
    };
    let starting = || Snapshot { has_ticked: false, reason: HoldReason::Starting, ..driving() };
    let held = || Snapshot { reason: HoldReason::StageHeld, held: vec!["mapper"], ..driving() };
    const MS: Duration = Duration::from_millis(1);
    let (early, late) = (NO_PROGRESS - MS, NO_PROGRESS);
    let nose = || Some("link: no nose".to_owned());
    use Outcome::{Aborted, Collision, Reached, Timeout, Unreachable};
    #[rustfmt::skip]
    let goes_on = [
        ("a driving robot goes on", driving(), early),
        ("an arrival on the wall clock waits for rest",
         Snapshot { arrival: arrival(0.1, 0), link: Some(&moving), in_ticks: false, ..driving() }, RESTS_WITHIN - MS),
        ("a stop by the link's failsafe is no end",
         Snapshot { link: Some(&stop), ..driving() }, early),
        ("the time of an operator's stop is no mission time", Snapshot { deadline: deadline(8.0, 3.0), ..driving() }, early),
        ("a real robot may be away", Snapshot { may_be_away: true, ..driving() }, late),
        ("a real robot may be away while its link says why it does not hear it",
         Snapshot { may_be_away: true, link: Some(&away), complaint: Some("link: refused".to_owned()), ..driving() }, late),
        ("an operator may wait", Snapshot { reason: HoldReason::Operator, ..driving() }, late),
        ("a held stage on the wall clock may wait", Snapshot { in_ticks: false, ..held() }, late),
    ];
    for (rule, snapshot, after) in goes_on {
        assert!(snapshot.ending(start + after).is_none(), "{rule}");
    }
    #[rustfmt::skip]
    let ends = [
        ("a simulator that ended", Snapshot { simulator_ended: true, arrival: arrival(0.1, 0), ..driving() }, early,
         Aborted, "x80-sim.log"),
        ("an arrival", Snapshot { arrival: arrival(0.123, 0), collision_m: Some([1.0, 2.0]), ..driving() }, early,
         Reached, "0.12 m from the target"),
        ("an arrival at rest",
         Snapshot { arrival: arrival(0.1, 0), link: Some(&resting), in_ticks: false, ..driving() }, early,
         Reached, "0.10 m from the target"),
        ("an arrival without a report of rest",
         Snapshot { arrival: arrival(0.1, 1), link: None, in_ticks: false, ..driving() }, RESTS_WITHIN + 1000 * MS,
         Aborted, "not seen at rest"),
        ("an end by the link's failsafe",
         Snapshot { link: Some(&end), collision_m: Some([1.0, 2.0]), ..driving() },
         early, Aborted, "battery"),
        ("a collision", Snapshot { collision_m: Some([1.0, 2.0]), deadline: deadline(5.0, 0.0), ..driving() }, early,
         Collision, "(1.00, 2.00)"),
        ("a timeout", Snapshot { deadline: deadline(10.0, 0.0), ..driving() }, late, Timeout, "10 s"),
        ("a timeout after an operator's stop", Snapshot { deadline: deadline(8.0, 2.0), ..driving() }, late,
         Timeout, "target not reached within 8 s, 2 s of operator stops excluded"),
        ("no tick while driving", driving(), late, Aborted, "stages' logs"),
        ("a real robot whose samples a stage cannot use is not away",
         Snapshot { may_be_away: true, complaint: nose(), ..driving() }, late,
         Aborted, "link: no nose"),
        ("a robot in a procedure may not be away", Snapshot { has_ticked: false, ..driving() }, late,
         Aborted, "no tick begins"),
        ("a real robot that is to start may not be away", Snapshot { may_be_away: true, link: None, ..starting() }, late,
         Aborted, "no robot answers at udp://10.0.0.1:10001"),
        ("a robot that answers and does not start", starting(), late, Aborted, "a sensor of its mission"),
        ("a robot that has begun a tick is not looked for", Snapshot { link: None, ..driving() }, late,
         Aborted, "stages' logs"),
        ("a robot of which a stage complains", Snapshot { link: None, complaint: nose(), ..starting() }, late,
         Aborted, "link: no nose"),
        ("a timeout while a stage complains",
         Snapshot { deadline: deadline(10.0, 0.0), complaint: nose(), ..driving() }, late,
         Timeout, "target not reached within 10 s; link: no nose"),
        ("an arrival beside the target", Snapshot { arrival: beside, ..driving() }, early,
         Unreachable, "0.36 m from the target, at [2.64, 0.00]: the nearest point that a hazard allows"),
        ("a held stage in ticks", held(), late, Aborted, "mapper died repeatedly"),
        ("a held stage that says why it died", Snapshot { complaint: Some("mapper: no disk".to_owned()), ..held() }, late,
         Aborted, "mapper died repeatedly (mapper: no disk)"),
        ("a stage that never becomes ready", Snapshot { not_ready: vec!["planner"], ..starting() }, late,
         Aborted, "not ready: planner; see the log"),
        ("an external stage that is missing", Snapshot { not_started: vec!["planner"], held: vec!["mapper"], ..starting() },
         late, Aborted, "not running: planner; start each with `firsthand stage NAME --robot x80`"),
    ];
    for (rule, snapshot, after, outcome, words) in ends {
        let ending = snapshot.ending(start + after).expect(rule);
        assert_eq!((ending.outcome, ending.asked_for), (outcome, outcome == Reached), "{rule}");
        assert!(ending.reason.contains(words), "{rule}: {}", ending.reason);
    }
}

#[test]
fn progress_is_when_a_tick_or_the_start_of_a_stage_was_first_seen() {
    let at = Duration::from_secs;
    let mut progress = TickProgress::new(at(0));
    for (tick, to_start, s, since) in [
        (None, 0, 1, at(0)),
        (None, 5, 2, at(2)),
        (None, 4, 3, at(3)),
        (Some(7), 4, 4, at(4)),
        (Some(7), 4, 5, at(4)),
    ] {
        assert_eq!(progress.update((tick, to_start), at(s)), since);
    }
}
