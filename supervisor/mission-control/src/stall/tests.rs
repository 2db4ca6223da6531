use super::*;
use GuidanceStatus::{Along, Look, Unreachable, Waiting, WayOut};
use RecoveryStep::{GiveUp, Replan, Reset};
use StallCause::{CutOff, Held, InsideHazard, Pinned, Relocated, Still, Wandering};
use common::samples::Stamp;

fn mission(more: &str) -> Mission {
    let text = format!("target = [3, 0]\n{more}");
    Mission::parse(&text, std::path::Path::new("test.toml")).unwrap()
}

fn watch() -> StallWatch {
    StallWatch::new(&mission("method = 'paper'"))
}

fn pose(seconds: f64, travelled_m: f64) -> PoseSample {
    PoseSample {
        stamp: Stamp {
            tick: MissionTime::from_seconds(seconds).0,
            stamp_ns: MissionTime::from_seconds(seconds).0,
            ..Stamp::default()
        },
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

#[test]
fn a_robot_that_moves_is_left_alone() {
    let mut watch = watch();
    for tick in (0..100).map(f64::from) {
        let driving = PoseSample { x_m: tick * 0.05, ..pose(tick, tick * 0.05) };
        assert_eq!(step(&mut watch, driving, guidance(Along, 0)), None);
    }
}

#[test]
fn a_stalled_robot_gets_a_fresh_planner_twice_then_a_fresh_belief() {
    let mut watch = watch();
    let along = guidance(Along, 0);
    let stalls: Vec<_> = (0..=10)
        .filter_map(|second| step(&mut watch, pose(f64::from(second), 0.0), along))
        .map(|stall| parts(&stall))
        .collect();
    assert_eq!(stalls, [(Still, Replan, 0), (Still, Replan, 0), (Still, Reset, 1)]);
}

#[test]
fn a_robot_held_by_something_else_is_not_stalled() {
    let mut watch = watch();
    let along = guidance(Along, 0);
    for second in 0..20 {
        assert_eq!(watch.step(&pose(f64::from(second), 0.0), &along, true, false), None);
    }
}

#[test]
fn a_robot_that_was_held_without_a_tick_is_not_stalled_at_the_next_one() {
    let mut watch = watch();
    let along = guidance(Along, 0);
    assert_eq!(step(&mut watch, pose(0.0, 0.0), along), None);
    watch.forget_motion();
    assert_eq!(step(&mut watch, pose(20.0, 0.0), along), None);
}

#[test]
fn a_robot_that_waits_for_a_field_is_not_stalled_until_that_takes_too_long() {
    let mut watch = watch();
    let waiting = guidance(Waiting, 0);
    let first = (0..300).find(|&second| {
        let pose = pose(f64::from(second), 0.0);
        step(&mut watch, pose, waiting).is_some()
    });
    let least = FIELD_WITHIN.as_secs() as i32;
    assert_eq!(first, Some(least + STALLED_AFTER.as_secs() as i32));
    // The next recovery step takes as long again.
    let second = pose(f64::from(least) + 10.0, 0.0);
    assert_eq!(step(&mut watch, second, waiting), None);
}

#[test]
fn what_a_robot_did_while_it_was_not_to_drive_is_no_stall() {
    let mut watch = watch();
    let along = guidance(Along, 0);
    let cut_off = guidance(Unreachable, 0);
    assert_eq!(step(&mut watch, pose(0.0, 0.0), along), None);
    assert_eq!(step(&mut watch, pose(0.5, 0.0), cut_off), None);
    let resumed = pose(20.0, 0.0);
    watch.hold(resumed.stamp.tick);
    assert_eq!(watch.tick(), Some(resumed.stamp.tick));
    assert_eq!(step(&mut watch, pose(20.2, 0.0), cut_off), None);
    assert_eq!(step(&mut watch, pose(20.4, 0.0), along), None);
}

#[test]
fn a_robot_cut_off_forgets_three_times_and_gives_up() {
    let mut watch = watch();
    let mut stalls = Vec::new();
    for tick in 0..100 {
        let cut_off = guidance(Unreachable, watch.epoch());
        let pose = pose(f64::from(tick) * 0.5, f64::from(tick));
        stalls.extend(step(&mut watch, pose, cut_off).map(|stall| parts(&stall)));
        if matches!(stalls.last(), Some((_, GiveUp, _))) {
            break;
        }
    }
    let steps = [(Reset, 1), (Reset, 2), (Reset, 3), (GiveUp, 3)];
    assert_eq!(stalls, steps.map(|(step, epoch)| (CutOff, step, epoch)));
}

#[test]
fn a_robot_cut_off_by_the_evidential_method_looks_around_before_its_belief_is_blamed() {
    let mission = mission("");
    let mut watch = StallWatch::new(&mission);
    let cut_off = guidance(Unreachable, 0);
    let turning = |second: f64| PoseSample { heading_rad: second, ..pose(second, 0.0) };
    let turn = TAU / mission.hurry().look_rad_s;
    let first = (0..100)
        .map(f64::from)
        .find(|&second| step(&mut watch, turning(second), cut_off).is_some());
    assert!(first > Some(turn) && first < Some(5.0 * turn), "{first:?}");
}

#[test]
fn a_scan_is_no_stall() {
    let mut watch = watch();
    let look = guidance(Look, 0);
    for tick in 0..75 {
        let seconds = f64::from(tick) * 0.2;
        let scanning = PoseSample { heading_rad: seconds.sin(), ..pose(seconds, 0.0) };
        assert_eq!(step(&mut watch, scanning, look), None);
    }
}

#[test]
fn an_answer_from_before_the_reset_does_not_reset_again() {
    let mut watch = watch();
    let old = guidance(Unreachable, 0);
    step(&mut watch, pose(0.0, 0.0), old);
    let reset = step(&mut watch, pose(1.0, 0.0), old);
    assert_eq!(reset.map(|stall| parts(&stall)), Some((CutOff, Reset, 1)));
    assert_eq!(step(&mut watch, pose(2.5, 0.1), old), None);
}

fn rock(watch: &mut StallWatch, seconds: std::ops::Range<u32>) -> Vec<StallSample> {
    let along = guidance(Along, 0);
    let rocking = seconds.filter_map(|second| {
        let seconds = f64::from(second);
        let rocking = PoseSample {
            x_m: 0.05 * seconds.sin(),
            heading_rad: seconds,
            ..pose(seconds, 0.05 * seconds)
        };
        step(watch, rocking, along)
    });
    rocking.collect()
}

#[test]
fn a_robot_that_moves_and_stays_where_it_is_gets_a_fresh_planner_twice_then_a_fresh_belief() {
    let stalls: Vec<_> = rock(&mut watch(), 0..60).iter().map(parts).collect();
    assert_eq!(stalls, [(Pinned, Replan, 0), (Pinned, Replan, 0), (Pinned, Reset, 1)]);
}

#[test]
fn a_robot_that_circles_what_it_should_stand_on_is_pinned_and_one_that_crawls_to_it_is_not() {
    let mission = mission("method = 'paper'");
    let (speed, turn) = (mission.speed_m_s(), mission.turn_rad_s());
    let radius = speed / turn;
    let mut circling = StallWatch::new(&mission);
    let mut crawling = StallWatch::new(&mission);
    let mut seen = [None; 2];
    for second in (0..40).map(f64::from) {
        let heading = turn * second;
        let circle = PoseSample {
            x_m: radius * heading.sin(),
            y_m: -radius * heading.cos(),
            heading_rad: heading,
            ..pose(second, speed * second)
        };
        let crawl = PoseSample { x_m: 0.01 * second, ..pose(second, 0.01 * second) };
        let near = |distance_m| GuidanceSample { distance_m, ..guidance(Along, 0) };
        let stalls = [
            step(&mut circling, circle, near(3.0 - circle.x_m)),
            step(&mut crawling, crawl, near(0.5 - crawl.x_m)),
        ];
        for (first, stall) in seen.iter_mut().zip(stalls) {
            *first = first.or(stall.map(|stall| stall.cause()));
        }
    }
    assert_eq!(seen, [Some(Pinned), None]);
}

#[test]
fn a_place_that_was_left_does_not_count() {
    let mut watch = watch();
    assert_eq!(rock(&mut watch, 0..40).len(), 2);
    let elsewhere = PoseSample { x_m: 1.0, ..pose(40.0, 3.0) };
    step(&mut watch, elsewhere, guidance(Along, 0));
    let recoveries: Vec<_> = rock(&mut watch, 41..85).iter().map(StallSample::recovery).collect();
    assert_eq!(recoveries, [Replan, Replan]);
    assert_eq!(watch.recoveries(None).0, 4);
}

#[test]
fn a_robot_that_drives_far_in_hazard_forgets_and_one_that_gets_out_does_not() {
    let way_out = guidance(WayOut, 0);
    let drive = |watch: &mut StallWatch, metres: std::ops::Range<u32>| {
        let mut driving = metres.map(|tenths| PoseSample {
            x_m: f64::from(tenths) * 0.1,
            ..pose(f64::from(tenths), f64::from(tenths) * 0.1)
        });
        let stall = driving.find_map(|pose| step(watch, pose, way_out));
        stall.map(|stall| parts(&stall))
    };
    let want = (InsideHazard, Reset, 1);
    assert_eq!(drive(&mut watch(), 0..12), Some(want));
    let mut watch = watch();
    assert_eq!(drive(&mut watch, 0..8), None);
    let out = PoseSample { x_m: 0.8, ..pose(8.0, 0.8) };
    step(&mut watch, out, guidance(Along, 0));
    assert_eq!(drive(&mut watch, 9..17), None);
}

#[test]
fn a_car_that_circles_on_its_tightest_circle_is_pinned_and_the_reason_names_the_radius() {
    let car = mission("robot.model = 'car'");
    let mut watch = StallWatch::new(&car);
    let radius = car.body().ackermann().unwrap().least_turning_radius();
    let along = guidance(Along, 0);
    let stall = (0..600).map(f64::from).find_map(|tick| {
        let (seconds, travelled) = (tick / 7.0, tick / 7.0 * 0.125);
        let turned = travelled / radius;
        let circling = PoseSample {
            x_m: radius * turned.sin(),
            y_m: radius * (1.0 - turned.cos()),
            heading_rad: turned,
            ..pose(seconds, travelled)
        };
        step(&mut watch, circling, along)
    });
    let cause = stall.map(|stall| stall.cause());
    assert_eq!(cause, Some(Pinned));
    let reason = words(Pinned, &car.body());
    assert!(reason.contains("least turning radius of 0.31 m"), "{reason}");
    assert!(!words(Pinned, &mission("").body()).contains("turning radius"));
}

#[test]
fn held_wheels_get_a_fresh_planner_at_once_and_again_elsewhere_and_are_held_fast_at_last() {
    let mut watch = watch();
    let held = |watch: &mut StallWatch, second: u32, x_m: f64| {
        let pose = PoseSample { x_m, ..pose(f64::from(second), x_m) };
        // The planner has no field yet.
        let stall = watch.step(&pose, &guidance(Waiting, 0), false, true);
        parts(&stall.unwrap())
    };
    for second in 0..4 {
        let here = held(&mut watch, second, f64::from(second));
        assert_eq!(here, (Held, Replan, 0));
    }
    let mut steps = Vec::new();
    while steps.last() != Some(&GiveUp) {
        let second = 10 + steps.len() as u32;
        // The robot turns about a blocked wheel.
        steps.push(held(&mut watch, second, 10.0 + 0.2 * f64::from(second % 2)).1);
    }
    let round = [Replan, Replan, Reset];
    assert_eq!(steps, [&round[..], &round, &round, &[Replan, Replan, GiveUp]].concat());
    let cause = watch.gave_up().unwrap().cause();
    assert!(words(cause, &mission("").body()).contains("held fast"));
}

#[test]
fn a_robot_that_drives_three_times_as_far_as_its_target_was_away_forgets_and_in_the_end_gives_up() {
    let stalls = |method: &str, target_m: f64| {
        let mut watch = StallWatch::new(&mission(&format!("method = '{method}'")));
        let mut stalls = Vec::new();
        for metre in (0..200).map(f64::from) {
            let along = GuidanceSample { distance_m: target_m, ..guidance(Along, watch.epoch()) };
            let pose = PoseSample { x_m: metre % 2.0, ..pose(2.0 * metre, metre) };
            if let Some(stall) = step(&mut watch, pose, along) {
                stalls.push((metre, stall.cause(), stall.recovery()));
                if stall.recovery() == GiveUp {
                    break;
                }
            }
        }
        stalls
    };
    let want = [(24.0, Reset), (49.0, Reset), (74.0, Reset), (99.0, GiveUp)];
    assert_eq!(
        stalls("evidential", 8.0),
        want.map(|(metre, recovery)| (metre, Wandering, recovery))
    );
    assert_eq!(stalls("evidential", 1.0)[0], (12.0, Wandering, Reset));
    assert_eq!(stalls("paper", 8.0), []);
}

#[test]
fn a_robot_with_a_laser_wanders_where_it_has_been_and_not_where_it_has_not() {
    let kobuki = mission("robot.model = 'kobuki'");
    let first = |x_m: fn(f64) -> f64| {
        let mut watch = StallWatch::new(&kobuki);
        (0..200).find(|&metre| {
            let metre = f64::from(metre);
            let pose = PoseSample { x_m: x_m(metre), ..pose(2.0 * metre, metre) };
            let guidance = GuidanceSample { distance_m: 3.0, ..guidance(Along, 0) };
            step(&mut watch, pose, guidance).is_some()
        })
    };
    assert_eq!(first(|metre| metre), None);
    // The limit is 12 m, plus 3 m for each of four squares.
    assert_eq!(first(|metre| metre % 4.0), Some(24));
}

#[test]
fn a_relocated_robot_forgets_all_of_its_map_each_time_and_gives_up_for_it_never() {
    let mut watch = watch();
    let along = guidance(Along, 0);
    let mut resets = Vec::new();
    for second in 0..20 {
        let place = f64::from(second);
        let relocations = u64::from(second as u32 / 3);
        let pose = PoseSample { relocations, x_m: place, ..pose(place, place) };
        resets.extend(step(&mut watch, pose, along).map(|stall| parts(&stall)));
    }
    // The mapper resets the evidence near the robot only in even epochs.
    let want = [2, 4, 6, 8, 10, 12].map(|epoch| (Relocated, Reset, epoch));
    assert_eq!(resets, want);
    assert_eq!(watch.recoveries(None), (0, 6));
    let cut_off = guidance(Unreachable, watch.epoch());
    let stalls = (20..30).filter_map(|second| {
        let pose = PoseSample { relocations: 6, ..pose(f64::from(second), f64::from(second)) };
        step(&mut watch, pose, cut_off)
    });
    assert_eq!(stalls.map(|stall| stall.recovery()).next(), Some(Reset));
}

#[test]
fn a_robot_that_stands_and_is_elsewhere_forgets_its_map_at_once_and_nothing_else_does_so() {
    let mut watch = watch();
    let stands = |watch: &mut StallWatch, second: f64, relocations| {
        watch.stand(&PoseSample { relocations, ..pose(second, 0.0) }, 3)
    };
    // Relocations before the first pose are known.
    assert_eq!(stands(&mut watch, 0.0, 5), None);
    assert_eq!(stands(&mut watch, 60.0, 5), None);
    let stall = stands(&mut watch, 61.0, 6).unwrap();
    assert_eq!(parts(&stall), (Relocated, Reset, 4));
    assert_eq!(stands(&mut watch, 62.0, 6), None);
    let driving = PoseSample { relocations: 6, ..pose(63.0, 0.0) };
    assert_eq!(step(&mut watch, driving, guidance(Along, 4)), None);
}

#[test]
fn a_fresh_planner_that_knows_no_target_yet_does_not_make_the_next_stall_the_first() {
    let mut watch = watch();
    let steps = (0..10).map(|second| {
        let target_number = [1, 0, 0][second as usize % 3];
        let guidance = GuidanceSample { target_number, ..guidance(Waiting, 0) };
        let stall = watch.step(&pose(f64::from(second), 0.0), &guidance, false, true);
        stall.unwrap().recovery()
    });
    let steps: Vec<_> = steps.collect();
    assert_eq!(steps[..3], [Replan, Replan, Reset], "{steps:?}");
}
