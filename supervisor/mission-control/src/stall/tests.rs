use super::*;
use crate::testing;
use GuidanceStatus::{Along, Look, Unreachable, Waiting, WayOut};
use RecoveryStep::{GiveUp, Replan, Reset};
use StallCause::{CutOff, Held, InsideHazard, Pinned, Relocated, Still, Wandering};
use common::samples::Stamp;
use std::ops::Range;

fn mission(more: &str) -> Mission {
    testing::mission(&format!("target = [3, 0]\n{more}"))
}

fn watch() -> StallWatch {
    StallWatch::new(&mission("method = 'paper'"))
}

fn pose(seconds: f64, travelled_m: f64) -> PoseSample {
    let time = MissionTime::from_seconds(seconds).0;
    PoseSample {
        stamp: Stamp { tick: time, stamp_ns: time, ..Stamp::default() },
        travelled_m,
        ..PoseSample::default()
    }
}

fn guidance(status: GuidanceStatus, epoch: u64) -> GuidanceSample {
    GuidanceSample { status: status.into(), epoch, ..GuidanceSample::default() }
}

fn step(watch: &mut StallWatch, pose: PoseSample, guidance: GuidanceSample) -> Option<StallSample> {
    watch.step(&pose, &guidance, false, false)
}

fn parts(stall: &StallSample) -> (StallCause, RecoveryStep, u64) {
    (stall.cause(), stall.recovery(), stall.epoch)
}

/// Returns the time of each stall until one gives up, and what it says, of a robot led alike, with
/// a pose in every second.
fn stalls(
    watch: &mut StallWatch,
    (status, distance_m): (GuidanceStatus, f64),
    seconds: Range<u32>,
    pose: impl Fn(f64) -> PoseSample,
) -> Vec<(f64, (StallCause, RecoveryStep, u64))> {
    let mut stalls = Vec::new();
    for pose in seconds.map(|second| pose(second.into())) {
        let along = GuidanceSample { distance_m, ..guidance(status, watch.epoch()) };
        if let Some(stall) = step(watch, pose, along) {
            stalls.push((pose.stamp.tick as f64 / 1e9, parts(&stall)));
            if stall.recovery() == GiveUp {
                break;
            }
        }
    }
    stalls
}

fn standing(second: f64) -> PoseSample {
    pose(second, 5.0)
}

#[test]
fn a_robot_that_moves_scans_waits_or_was_held_is_not_stalled() {
    let moving = |it| PoseSample { x_m: it * 0.05, ..pose(it, it * 0.05) };
    assert_eq!(stalls(&mut watch(), (Along, 3.0), 0..100, moving), []);
    let scanning = |it: f64| PoseSample { heading_rad: it.sin(), ..pose(it, 0.0) };
    assert_eq!(stalls(&mut watch(), (Look, 3.0), 0..75, |it| scanning(it * 0.2)), []);
    let mut held = watch();
    for second in 0..20 {
        let held = held.step(&standing(second.into()), &guidance(Along, 0), true, false);
        assert_eq!(held, None, "held by another");
    }
    let mut without_ticks = watch();
    assert_eq!(step(&mut without_ticks, pose(0.0, 0.0), guidance(Along, 0)), None);
    without_ticks.forget_motion();
    assert_eq!(step(&mut without_ticks, pose(20.0, 0.0), guidance(Along, 0)), None);
    let waits_s = (FIELD_WITHIN + STALLED_AFTER).as_secs_f64();
    let waiting = stalls(&mut watch(), (Waiting, 3.0), 0..300, standing);
    // The next recovery step takes as long again.
    assert!(waiting[0].0 == waits_s && waiting[1].0 > waits_s + 5.0, "{waiting:?}");
}

#[test]
fn what_a_robot_did_while_it_was_not_to_drive_is_no_stall() {
    let mut watch = watch();
    let said = |watch: &mut StallWatch, seconds, status| {
        step(watch, pose(seconds, 0.0), guidance(status, 0))
    };
    assert_eq!(said(&mut watch, 0.0, Along), None);
    assert_eq!(said(&mut watch, 0.5, Unreachable), None);
    let resumed = pose(20.0, 0.0).stamp.tick;
    watch.hold(resumed);
    assert_eq!(watch.tick(), Some(resumed));
    assert_eq!(said(&mut watch, 20.2, Unreachable), None);
    assert_eq!(said(&mut watch, 20.4, Along), None);
}

#[test]
fn a_robot_cut_off_by_the_evidential_method_looks_around_before_its_belief_is_blamed() {
    let mission = mission("");
    let turning = |it| PoseSample { heading_rad: it, ..pose(it, 0.0) };
    let mut watch = StallWatch::new(&mission);
    let first = stalls(&mut watch, (Unreachable, 3.0), 0..100, turning)[0].0;
    let turn = TAU / mission.hurry().look_rad_s;
    assert!(first > turn && first < 5.0 * turn, "{first}");
}

#[test]
fn an_answer_from_before_the_reset_does_not_reset_again() {
    let mut watch = watch();
    let old = guidance(Unreachable, 0);
    step(&mut watch, pose(0.0, 0.0), old);
    let reset = step(&mut watch, pose(1.0, 0.0), old).unwrap();
    assert_eq!(parts(&reset), (CutOff, Reset, 1));
    assert_eq!(step(&mut watch, pose(2.5, 0.1), old), None);
}

#[test]
fn a_robot_that_stands_or_moves_where_it_is_gets_a_fresh_planner_twice_then_a_fresh_belief() {
    let rocking =
        |it: f64| PoseSample { x_m: 0.05 * it.sin(), heading_rad: it, ..pose(it, 0.05 * it) };
    let told = |watch: &mut StallWatch, seconds, moves: fn(f64) -> PoseSample| -> Vec<_> {
        stalls(watch, (Along, 3.0), seconds, moves).into_iter().map(|it| it.1).collect()
    };
    let all = |cause| [(cause, Replan, 0), (cause, Replan, 0), (cause, Reset, 1)];
    assert_eq!(told(&mut watch(), 0..11, standing), all(Still));
    assert_eq!(told(&mut watch(), 0..60, rocking), all(Pinned));
    let mut watch = watch();
    assert_eq!(told(&mut watch, 0..40, rocking), all(Pinned)[..2]);
    let elsewhere = PoseSample { x_m: 1.0, ..pose(40.0, 3.0) };
    step(&mut watch, elsewhere, guidance(Along, 0));
    let again = told(&mut watch, 41..85, rocking);
    assert_eq!(again, all(Pinned)[..2], "a place that was left does not count");
    assert_eq!(watch.recoveries(None).0, 4);
}

#[test]
fn a_robot_that_circles_what_it_should_stand_on_is_pinned_and_one_that_crawls_to_it_is_not() {
    let mission = mission("method = 'paper'");
    let (speed, turn) = (mission.speed_m_s(), mission.turn_rad_s());
    let radius = speed / turn;
    let circle = |second: f64| {
        let heading_rad = turn * second;
        let (x_m, y_m) = (radius * heading_rad.sin(), -radius * heading_rad.cos());
        PoseSample { x_m, y_m, heading_rad, ..pose(second, speed * second) }
    };
    let crawl = |second| PoseSample { x_m: 0.01 * second, ..pose(second, 0.01 * second) };
    let seen =
        [(3.0, &circle as &dyn Fn(f64) -> PoseSample), (0.5, &crawl)].map(|(away_m, pose)| {
            let mut watch = StallWatch::new(&mission);
            (0..40).map(f64::from).map(pose).find_map(|pose| {
                let near = GuidanceSample { distance_m: away_m - pose.x_m, ..guidance(Along, 0) };
                step(&mut watch, pose, near).map(|stall| stall.cause())
            })
        });
    assert_eq!(seen, [Some(Pinned), None]);
}

#[test]
fn a_robot_that_drives_far_in_hazard_forgets_and_one_that_gets_out_does_not() {
    let driving = |it| PoseSample { x_m: it * 0.1, ..pose(it, it * 0.1) };
    let drive = |watch: &mut StallWatch, seconds| stalls(watch, (WayOut, 3.0), seconds, driving);
    assert_eq!(drive(&mut watch(), 0..12)[0].1, (InsideHazard, Reset, 1));
    let mut watch = watch();
    assert_eq!(drive(&mut watch, 0..8), []);
    step(&mut watch, driving(8.0), guidance(Along, 0));
    assert_eq!(drive(&mut watch, 9..17), []);
}

#[test]
fn held_wheels_get_a_fresh_planner_at_once_and_again_elsewhere_and_are_held_fast_at_last() {
    let mut watch = watch();
    let held = |watch: &mut StallWatch, second: u32, x_m: f64| {
        let pose = PoseSample { x_m, ..pose(second.into(), x_m) };
        // The planner has no field yet.
        parts(&watch.step(&pose, &guidance(Waiting, 0), false, true).unwrap())
    };
    for second in 0..4_u32 {
        assert_eq!(held(&mut watch, second, second.into()), (Held, Replan, 0));
    }
    // The robot turns about a blocked wheel.
    let steps =
        (10..22_u32).map(|second| held(&mut watch, second, 10.0 + 0.2 * f64::from(second % 2)).1);
    let steps: Vec<_> = steps.collect();
    let round = [Replan, Replan, Reset];
    assert_eq!(steps, [round, round, round, [Replan, Replan, GiveUp]].concat());
    let cause = watch.gave_up().unwrap().cause();
    assert!(words(cause, &mission("").body()).contains("held fast"));
}

#[test]
fn a_robot_that_drives_three_times_as_far_as_its_target_was_away_forgets_and_in_the_end_gives_up() {
    for (method, target_m, want) in [
        ("evidential", 8.0, &[24.0, 49.0, 74.0, 99.0][..]),
        ("evidential", 1.0, &[12.0, 25.0, 38.0, 51.0]),
        ("paper", 8.0, &[]),
    ] {
        let mut watch = StallWatch::new(&mission(&format!("method = '{method}'")));
        let poses = |it| PoseSample { x_m: it % 2.0, ..pose(2.0 * it, it) };
        let stalls = stalls(&mut watch, (Along, target_m), 0..200, poses);
        let steps = [Reset, Reset, Reset, GiveUp];
        let want: Vec<_> =
            want.iter().zip(steps).map(|(it, step)| (2.0 * it, Wandering, step)).collect();
        let stalls: Vec<_> = stalls.into_iter().map(|it| (it.0, it.1.0, it.1.1)).collect();
        assert_eq!(stalls, want, "{method}, {target_m} m");
    }
}

#[test]
fn a_robot_with_a_laser_wanders_where_it_has_been_and_not_where_it_has_not() {
    // The limit is 12 m, plus 3 m for each of four squares.
    for (round_m, want) in [(1e9, None), (4.0, Some(24.0))] {
        let mut watch = StallWatch::new(&mission("robot.model = 'kobuki'"));
        let poses = |it| PoseSample { x_m: it % round_m, ..pose(2.0 * it, it) };
        let stalls = stalls(&mut watch, (Along, 3.0), 0..200, poses);
        let first = stalls.first().map(|it| it.0 / 2.0);
        assert_eq!(first, want, "rounds of {round_m} m");
    }
}

#[test]
fn a_relocated_robot_forgets_all_of_its_map_each_time_and_gives_up_for_it_never() {
    let mut watch = watch();
    let along = guidance(Along, 0);
    let mut resets = Vec::new();
    for second in 0..20_u32 {
        let x_m = f64::from(second);
        let pose = PoseSample { relocations: u64::from(second / 3), x_m, ..pose(x_m, x_m) };
        resets.extend(step(&mut watch, pose, along).map(|stall| parts(&stall)));
    }
    // The mapper resets the evidence near the robot only in even epochs.
    let want = [2, 4, 6, 8, 10, 12].map(|epoch| (Relocated, Reset, epoch));
    assert_eq!(resets, want);
    assert_eq!(watch.recoveries(None), (0, 6));
    let poses = |it| PoseSample { relocations: 6, ..pose(it, it) };
    assert_eq!(stalls(&mut watch, (Unreachable, 3.0), 20..30, poses)[0].1.1, Reset);
}

#[test]
fn a_robot_that_stands_and_is_elsewhere_forgets_its_map_at_once_and_nothing_else_does_so() {
    let mut watch = watch();
    let mut stands = |second, relocations| {
        let stall = watch.stand(&PoseSample { relocations, ..pose(second, 0.0) }, 3);
        stall.map(|stall| parts(&stall))
    };
    // Relocations before the first pose are known.
    assert_eq!([stands(0.0, 5), stands(60.0, 5)], [None; 2]);
    assert_eq!(stands(61.0, 6), Some((Relocated, Reset, 4)));
    assert_eq!(stands(62.0, 6), None);
    let driving = PoseSample { relocations: 6, ..pose(63.0, 0.0) };
    assert_eq!(step(&mut watch, driving, guidance(Along, 4)), None);
}

#[test]
fn a_fresh_planner_that_knows_no_target_yet_does_not_make_the_next_stall_the_first() {
    let mut watch = watch();
    let steps = [(0.0, 1), (1.0, 0), (2.0, 0)].map(|(second, target_number)| {
        let guidance = GuidanceSample { target_number, ..guidance(Waiting, 0) };
        watch.step(&pose(second, 0.0), &guidance, false, true).unwrap().recovery()
    });
    assert_eq!(steps, [Replan, Replan, Reset]);
}

#[test]
fn ticks_before_another_target_are_not_checked_for_it() {
    let mut watch = watch();
    watch.settle(Some(3));
    assert_eq!(watch.tick(), None, "the first tick counts the relocations");
    step(&mut watch, PoseSample::default(), guidance(Along, 0));
    watch.settle(Some(4));
    watch.settle(None);
    assert_eq!(watch.tick(), Some(4));
}
