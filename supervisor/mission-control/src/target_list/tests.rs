use std::path::Path;

use common::samples::{GuidanceSample, GuidanceStatus, PoseSample, Stamp};
use glam::DVec2;

use super::*;

fn mission(extra: &str) -> Mission {
    let text = format!("target = [3, 0]\nperimeter.width_m = 8\n{extra}");
    Mission::parse(&text, Path::new("m.toml")).unwrap()
}

fn at(x: f64, y: f64) -> TargetPoint {
    TargetPoint::at(DVec2::new(x, y))
}

fn arrival(tick: u64) -> CommandSample {
    let stamp = Stamp { tick, stamp_ns: tick * 1_000_000_000, ..Stamp::default() };
    CommandSample { stamp, distance_m: 0.1, ..CommandSample::default() }
}

fn outcomes(results: &[TargetResult]) -> Vec<(u64, TargetOutcome)> {
    results.iter().map(|result| (result.number, result.outcome)).collect()
}

#[test]
fn a_list_goes_on_from_target_to_target_and_says_what_became_of_each() {
    use TargetOutcome::{Missed, NotTried, Reached, ReachedUnsure, Replaced};
    let mut list = TargetList::of(&mission(""));
    assert!(list.append(&[at(1.0, 1.0), at(2.0, 2.0)]));
    let TargetSample { number, last, since_tick, target, .. } = list.sample();
    assert_eq!((number, last, since_tick, target), (1, 3, 0, at(3.0, 0.0)));
    assert_eq!(list.sample().ahead(), [at(1.0, 1.0), at(2.0, 2.0)]);
    list.advance((arrival(7), Reached), 8);
    let TargetSample { number, last, since_tick, target, .. } = list.sample();
    assert_eq!((number, last, since_tick, target), (2, 3, 8, at(1.0, 1.0)));
    assert_eq!(list.began_s, 7.0);
    list.replace(&[at(0.5, 0.0), at(0.0, 0.0)], (12, 11.0), None);
    let TargetSample { number, last, since_tick, target, .. } = list.sample();
    assert_eq!((number, last, since_tick, target), (4, 5, 12, at(0.5, 0.0)));
    list.advance((arrival(20), ReachedUnsure), 21);
    assert!(list.is_last());
    let reached = Ending::asked_for(Outcome::Reached, "");
    let results = list.results(&reached, Some(30), Some(&arrival(30)), None);
    let want = [(1, Reached), (2, Replaced), (3, Replaced), (4, ReachedUnsure), (5, Reached)];
    assert_eq!(outcomes(&results), want);
    assert!((results[4].at_s.unwrap() - 30.0).abs() < 1e-9);
    assert_eq!(of_all(reached, &results).outcome, Outcome::ReachedUnsure);
    // The contact in tick 15 was seen after the arrival in tick 20.
    let touched = Ending::failed(Outcome::Collision, "");
    let results = list.results(&touched, Some(14), None, None);
    assert_eq!(outcomes(&results)[2..], [(3, Replaced), (4, Missed), (5, NotTried)]);
}

#[test]
fn an_arrival_beside_a_hazard_is_reached_within_the_tolerance_and_unreachable_beyond_it() {
    let beside = |distance_m, status: GuidanceStatus| {
        let mut record = Record::default();
        let command = CommandSample { distance_m, ..arrival(7) };
        record.arrival = Some(command);
        record.poses.push(PoseSample { stamp: command.stamp, x_m: 2.6, ..PoseSample::default() });
        let guidance = GuidanceSample {
            stamp: command.stamp,
            status: status.into(),
            ..GuidanceSample::default()
        };
        record.guidance.push_back(guidance);
        let mut list = TargetList::of(&mission(""));
        assert!(list.append(&[at(0.0, 0.0)]));
        list.advance(record.sure_arrival(&mission("")).unwrap(), 8);
        let reached = Ending::asked_for(Outcome::Reached, "");
        let results = list.results(&reached, Some(9), Some(&arrival(9)), None);
        of_all(reached, &results).outcome
    };
    assert_eq!(beside(0.36, GuidanceStatus::AtTarget), Outcome::Unreachable);
    assert_eq!(beside(0.14, GuidanceStatus::AtTarget), Outcome::Reached);
    assert_eq!(beside(0.16, GuidanceStatus::Along), Outcome::Reached, "it turned to its heading");
}

#[test]
fn an_arrival_that_the_ground_truth_contradicts_makes_the_whole_list_wrong() {
    let pose = PoseSample { stamp: arrival(7).stamp, left_counts: 7, ..PoseSample::default() };
    let truth = |x, tick| GroundTruthTick { tick, x, left_counts: 7, ..GroundTruthTick::default() };
    for (x, outcome) in [(2.6, Outcome::Reached), (2.4, Outcome::WrongPlace)] {
        let mut list = TargetList::of(&mission(""));
        assert!(list.append(&[at(0.0, 0.0)]));
        list.advance((arrival(7), TargetOutcome::Reached), 8);
        let mut record = Record::default();
        record.poses.push(pose);
        list.compare(&record, &[truth(x, 7)], 0.5);
        let reached = Ending::asked_for(Outcome::Reached, "");
        let results = list.results(&reached, Some(9), Some(&arrival(9)), None);
        assert!((results[0].truth_m.unwrap() - (3.0 - x)).abs() < 1e-12, "{results:?}");
        assert_eq!(of_all(reached, &results).outcome, outcome);
    }
}

#[test]
fn every_reason_against_a_target_has_its_answer() {
    use RequestAnswer::{
        FixedTarget, InHazard, Malformed, NoHeading, NotRunning, Outside, Stopped,
    };
    let plain = mission("");
    let frame = plain.grid_frame();
    let mut cells = vec![common::grid::CellState::Free as u8; frame.area()];
    let hazard = frame.cell_at(DVec2::new(1.0, 1.0)).unwrap();
    cells[frame.index(hazard)] = common::grid::CellState::Sensed as u8;
    let part = common::grid::Part::whole(frame, 1);
    let mut record = Record::default();
    record.grid.apply(&part, &cells);
    let car = mission("robot.model = 'car'");
    let calibrates = mission("planner.calibration = { procedure = 'wall' }");
    let faces = TargetPoint { has_heading: 1, ..at(2.0, 0.0) };
    let nowhere = at(f64::NAN, 0.0);
    use HoldReason::{Ending, None as Drives, Operator, StageHeld, Starting};
    #[rustfmt::skip]
    let rows = [
        (&plain, Drives, Some(at(2.0, 0.0)), None),
        (&plain, StageHeld, Some(faces), None),
        (&plain, Starting, Some(at(2.0, 0.0)), Some(NotRunning)),
        (&plain, Ending, Some(at(2.0, 0.0)), Some(NotRunning)),
        (&plain, Operator, Some(at(2.0, 0.0)), Some(Stopped)),
        (&plain, Drives, None, Some(Malformed)),
        (&plain, Drives, Some(nowhere), Some(Malformed)),
        (&plain, Drives, Some(at(9.0, 0.0)), Some(Outside)),
        (&plain, Drives, Some(at(3.99, 0.0)), Some(Outside)),
        (&plain, Drives, Some(at(1.0, 1.0)), Some(InHazard)),
        (&car, Drives, Some(faces), Some(NoHeading)),
        (&calibrates, Drives, Some(at(2.0, 0.0)), Some(FixedTarget)),
    ];
    for (mission, reason, point, want) in rows {
        let points = point.as_ref().map(std::slice::from_ref);
        assert_eq!(refusal(points, reason, mission, &record), want, "{reason:?} {point:?}");
    }
    let unmapped = refusal(Some(&[at(2.0, 0.0)]), Drives, &plain, &Record::default());
    assert_eq!(unmapped, Some(NotRunning));
}

#[test]
fn a_robot_that_stays_has_a_result_for_each_target_and_none_for_the_wait() {
    use TargetOutcome::{NotTried, Reached, Replaced, TimedOut};
    let stays = Mission::parse("stay = true\nperimeter.width_m = 8", Path::new("m.toml")).unwrap();
    let mut list = TargetList::of(&stays);
    assert_eq!((list.waits, list.outcome_while_waiting()), (true, Some(Outcome::Waited)));
    list.replace(&[at(1.0, 0.0), at(2.0, 0.0)], (5, 5.0), None);
    assert!(!list.waits);
    list.settle(Outcome::Timeout, 9.0, None);
    assert_eq!(list.outcome_while_waiting(), Some(Outcome::Timeout));
    list.replace(&[at(0.5, 0.0)], (20, 20.0), None);
    list.settle(Outcome::Reached, 30.0, Some((arrival(30), Reached)));
    assert_eq!(list.outcome_while_waiting(), Some(Outcome::Reached));
    list.replace(&[at(4.0, 0.0)], (31, 31.0), None);
    list.replace(&[at(0.7, 0.0)], (32, 32.0), None);
    list.by_hand = true;
    assert!(list.release());
    assert_eq!(list.outcome_while_waiting(), Some(Outcome::Waited), "left for the hand");
    let results = list.results(&Ending::asked_for(Outcome::Reached, ""), None, None, None);
    assert_eq!(outcomes(&results), [(1, TimedOut), (2, NotTried), (3, Reached), (4, Replaced)]);
}

#[test]
fn a_hands_target_has_no_result_and_ends_in_waiting_for_the_next_one() {
    use TargetOutcome::{Reached, Replaced};
    let mut list = TargetList::of(&mission("stay = true"));
    let hand = |list: &mut TargetList, x| {
        list.replace(&[at(x, 0.0)], (5, 4.0), None);
        list.by_hand = true;
    };
    hand(&mut list, 0.5);
    hand(&mut list, 0.6);
    assert_eq!((list.number, list.waits, list.has_target()), (3, false, false));
    list.settle(Outcome::Reached, 6.0, Some((arrival(6), Reached)));
    assert!(list.waits && !list.release());
    hand(&mut list, 0.7);
    assert!(list.release() && list.waits);
    hand(&mut list, 0.8);
    assert_eq!(list.outcome_while_waiting(), Some(Outcome::Waited));
    list.replace(&[at(2.0, 0.0)], (9, 8.0), None);
    assert!(list.has_target());
    list.settle(Outcome::Reached, 9.0, Some((arrival(9), Reached)));
    let ending = Ending::asked_for(Outcome::Reached, "");
    let results = list.results(&ending, None, None, None);
    assert_eq!(outcomes(&results), [(1, Replaced), (6, Reached)]);
}
