use common::{
    grid::{CellState, Part},
    samples::{GuidanceSample, GuidanceStatus, PoseSample, Stamp},
};

use super::*;
use crate::testing;

fn mission(extra: &str) -> Mission {
    testing::mission(&format!("target = [3, 0]\nperimeter.width_m = 8\n{extra}"))
}

fn at(x: f64, y: f64) -> TargetPoint {
    TargetPoint::at(DVec2::new(x, y))
}

fn arrival(tick: u64) -> CommandSample {
    let stamp = Stamp { tick, stamp_ns: tick * 1_000_000_000, ..Stamp::default() };
    CommandSample { stamp, distance_m: 0.1, ..CommandSample::default() }
}

fn reached() -> Ending {
    Ending::asked_for(Outcome::Reached, "")
}

/// Returns a list of two targets after this arrival at the first.
fn advanced(arrival: Arrived) -> TargetList {
    let mut list = TargetList::of(&mission(""));
    assert!(list.append(&[at(0.0, 0.0)]));
    list.advance(arrival, 8);
    list
}

/// Returns the results of a run that reached its last target in tick 30, and its outcome.
fn results(list: &TargetList) -> (Vec<TargetResult>, Outcome) {
    let results = list.results(&reached(), Some(30), Some(&arrival(30)), None);
    let outcome = of_all(reached(), &results).outcome;
    (results, outcome)
}

fn outcomes(results: &[TargetResult]) -> Vec<(u64, TargetOutcome)> {
    results.iter().map(|result| (result.number, result.outcome)).collect()
}

#[test]
fn a_list_goes_on_from_target_to_target_and_says_what_became_of_each() {
    use TargetOutcome::{Missed, NotTried, Reached, ReachedUnsure, Replaced};
    let mut list = TargetList::of(&mission(""));
    assert!(list.append(&[at(1.0, 1.0), at(2.0, 2.0)]));
    let told = |list: &TargetList| {
        let TargetSample { number, last, since_tick, target, .. } = list.sample();
        (number, last, since_tick, target)
    };
    assert_eq!(told(&list), (1, 3, 0, at(3.0, 0.0)));
    assert_eq!(list.sample().ahead(), [at(1.0, 1.0), at(2.0, 2.0)]);
    list.advance((arrival(7), Reached), 8);
    assert_eq!(told(&list), (2, 3, 8, at(1.0, 1.0)));
    assert_eq!(list.began_s, 7.0);
    list.replace(&[at(0.5, 0.0), at(0.0, 0.0)], (12, 11.0), None);
    assert_eq!(told(&list), (4, 5, 12, at(0.5, 0.0)));
    list.advance((arrival(20), ReachedUnsure), 21);
    assert!(list.is_last());
    let (all, outcome) = results(&list);
    let want = [(1, Reached), (2, Replaced), (3, Replaced), (4, ReachedUnsure), (5, Reached)];
    assert_eq!((outcomes(&all), outcome), (want.to_vec(), Outcome::ReachedUnsure));
    assert!((all[4].at_s.unwrap() - 30.0).abs() < 1e-9);
    // The contact in tick 15 was seen after the arrival in tick 20.
    let touched = Ending::failed(Outcome::Collision, "");
    let all = list.results(&touched, Some(14), None, None);
    assert_eq!(outcomes(&all)[2..], [(3, Replaced), (4, Missed), (5, NotTried)]);
}

#[test]
fn an_arrival_beside_a_hazard_is_reached_within_the_tolerance_and_unreachable_beyond_it() {
    use GuidanceStatus::{Along, AtTarget};
    for (distance_m, status, want) in [
        (0.36, AtTarget, Outcome::Unreachable),
        (0.14, AtTarget, Outcome::Reached),
        // It turned to its heading.
        (0.16, Along, Outcome::Reached),
    ] {
        let command = CommandSample { distance_m, ..arrival(7) };
        let (stamp, status) = (command.stamp, status.into());
        let mut record = Record::default();
        record.arrival = Some(command);
        record.poses.push(PoseSample { stamp, x_m: 2.6, ..PoseSample::default() });
        record.guidance.push_back(GuidanceSample { stamp, status, ..GuidanceSample::default() });
        let list = advanced(record.sure_arrival(&mission("")).unwrap());
        assert_eq!(results(&list).1, want, "{distance_m}");
    }
}

#[test]
fn an_arrival_that_the_ground_truth_contradicts_makes_the_whole_list_wrong() {
    let pose = PoseSample { stamp: arrival(7).stamp, left_counts: 7, ..PoseSample::default() };
    for (x, outcome) in [(2.6, Outcome::Reached), (2.4, Outcome::WrongPlace)] {
        let mut list = advanced((arrival(7), TargetOutcome::Reached));
        let mut record = Record::default();
        record.poses.push(pose);
        let truth = GroundTruthTick { tick: 7, x, left_counts: 7, ..GroundTruthTick::default() };
        list.compare(&record, &[truth], 0.5);
        let (results, whole) = results(&list);
        assert!((results[0].truth_m.unwrap() - (3.0 - x)).abs() < 1e-12, "{results:?}");
        assert_eq!(whole, outcome);
    }
}

#[test]
fn every_reason_against_a_target_has_its_answer() {
    use RequestAnswer::{
        FixedTarget, InHazard, Malformed, NoHeading, NotRunning, Outside, Stopped,
    };
    let plain = mission("");
    let frame = plain.grid_frame();
    let mut cells = vec![CellState::Free as u8; frame.area()];
    let hazard = frame.cell_at(DVec2::new(1.0, 1.0)).unwrap();
    cells[frame.index(hazard)] = CellState::Sensed as u8;
    let mut record = Record::default();
    record.grid.apply(&Part::whole(frame, 1), &cells);
    let car = mission("robot.model = 'car'");
    let calibrates = mission("planner.calibration = { procedure = 'wall' }");
    let there = at(2.0, 0.0);
    let faces = TargetPoint { has_heading: 1, ..there };
    use HoldReason::{Ending, None as Drives, Operator, StageHeld, Starting};
    let answer = |mission, reason, point, record| refusal(Some(&[point]), reason, mission, record);
    for reason in [Drives, StageHeld] {
        assert_eq!(answer(&plain, reason, faces, &record), None, "{reason:?}");
    }
    for (mission, reason, point, want) in [
        (&plain, Starting, there, NotRunning),
        (&plain, Ending, there, NotRunning),
        (&plain, Operator, there, Stopped),
        (&plain, Drives, at(f64::NAN, 0.0), Malformed),
        (&plain, Drives, at(9.0, 0.0), Outside),
        (&plain, Drives, at(3.99, 0.0), Outside),
        (&plain, Drives, at(1.0, 1.0), InHazard),
        (&car, Drives, faces, NoHeading),
        (&calibrates, Drives, there, FixedTarget),
    ] {
        let got = answer(mission, reason, point, &record);
        assert_eq!(got, Some(want), "{reason:?} {point:?}");
    }
    assert_eq!(refusal(None, Drives, &plain, &record), Some(Malformed));
    assert_eq!(answer(&plain, Drives, there, &Record::default()), Some(NotRunning));
}

#[test]
fn a_robot_that_stays_has_a_result_for_each_target_and_none_for_the_wait() {
    use TargetOutcome::{NotTried, Reached, Replaced, TimedOut};
    let stays = testing::mission("stay = true\nperimeter.width_m = 8");
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
    let (results, _) = results(&list);
    assert_eq!(outcomes(&results), [(1, TimedOut), (2, NotTried), (3, Reached), (4, Replaced)]);
}

#[test]
fn a_hands_target_has_no_result_and_ends_in_waiting_for_the_next_one() {
    use TargetOutcome::{Reached, Replaced};
    let mut list = TargetList::of(&mission("stay = true"));
    let hand = |list: &mut TargetList| {
        list.replace(&[at(0.5, 0.0)], (5, 4.0), None);
        list.by_hand = true;
    };
    hand(&mut list);
    hand(&mut list);
    assert_eq!((list.number, list.waits, list.has_target()), (3, false, false));
    list.settle(Outcome::Reached, 6.0, Some((arrival(6), Reached)));
    assert!(list.waits && !list.release());
    hand(&mut list);
    assert!(list.release() && list.waits);
    hand(&mut list);
    assert_eq!(list.outcome_while_waiting(), Some(Outcome::Waited));
    list.replace(&[at(2.0, 0.0)], (9, 8.0), None);
    assert!(list.has_target());
    list.settle(Outcome::Reached, 9.0, Some((arrival(9), Reached)));
    let (results, _) = results(&list);
    assert_eq!(outcomes(&results), [(1, Replaced), (6, Reached)]);
}
