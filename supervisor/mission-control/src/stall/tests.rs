use super::*;
use common::samples::Stamp;

fn watch() -> StallWatch {
    let path = std::path::Path::new("test.toml");
    StallWatch::new(&Mission::parse("target = [3, 0]\nmethod = 'paper'", path).unwrap())
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

/// Cause, recovery step and epoch of a stall.
fn parts(stall: &StallSample) -> (StallCause, RecoveryStep, u64) {
    (stall.cause(), stall.recovery(), stall.epoch)
}

#[test]
fn a_robot_that_moves_is_left_alone() {
    let mut watch = watch();
    for tick in (0..100).map(f64::from) {
        let driving = PoseSample { x_m: tick * 0.05, ..pose(tick, tick * 0.05) };
        assert_eq!(watch.step(&driving, &guidance(GuidanceStatus::Along, 0), false, false), None);
    }
}

#[test]
fn a_stalled_robot_gets_a_fresh_planner_twice_then_a_fresh_belief() {
    let mut watch = watch();
    let along = guidance(GuidanceStatus::Along, 0);
    let stalls: Vec<_> = (0..=10)
        .filter_map(|second| watch.step(&pose(f64::from(second), 0.0), &along, false, false))
        .map(|stall| parts(&stall))
        .collect();
    let cause = StallCause::Still;
    let want = [
        (cause, RecoveryStep::Replan, 0),
        (cause, RecoveryStep::Replan, 0),
        (cause, RecoveryStep::Reset, 1),
    ];
    assert_eq!(stalls, want);
}

#[test]
fn a_robot_held_by_something_else_is_not_stalled() {
    let mut watch = watch();
    let along = guidance(GuidanceStatus::Along, 0);
    for second in 0..20 {
        assert_eq!(watch.step(&pose(f64::from(second), 0.0), &along, true, false), None);
    }
}

#[test]
fn a_robot_that_was_held_without_a_tick_is_not_stalled_at_the_next_one() {
    let mut watch = watch();
    let along = guidance(GuidanceStatus::Along, 0);
    assert_eq!(watch.step(&pose(0.0, 0.0), &along, false, false), None);
    watch.forget_motion();
    assert_eq!(watch.step(&pose(20.0, 0.0), &along, false, false), None);
}

#[test]
fn a_robot_that_waits_for_a_field_is_not_stalled_until_that_takes_too_long() {
    let mut watch = watch();
    let waiting = guidance(GuidanceStatus::Waiting, 0);
    let first = (0..300).find(|&second| {
        let pose = pose(f64::from(second), 0.0);
        watch.step(&pose, &waiting, false, false).is_some()
    });
    let least = FIELD_WITHIN.as_secs() as i32;
    assert_eq!(first, Some(least + STALLED_AFTER.as_secs() as i32));
    // The next recovery step comes after as long again.
    let second = pose(f64::from(least) + 10.0, 0.0);
    assert_eq!(watch.step(&second, &waiting, false, false), None);
}

#[test]
fn what_a_robot_did_while_it_was_not_to_drive_is_no_stall() {
    let mut watch = watch();
    let along = guidance(GuidanceStatus::Along, 0);
    let cut_off = guidance(GuidanceStatus::Unreachable, 0);
    assert_eq!(watch.step(&pose(0.0, 0.0), &along, false, false), None);
    assert_eq!(watch.step(&pose(0.5, 0.0), &cut_off, false, false), None);
    let resumed = pose(20.0, 0.0);
    watch.hold(resumed.stamp.tick);
    assert_eq!(watch.tick(), Some(resumed.stamp.tick));
    assert_eq!(watch.step(&pose(20.2, 0.0), &cut_off, false, false), None);
    assert_eq!(watch.step(&pose(20.4, 0.0), &along, false, false), None);
}

#[test]
fn a_robot_cut_off_forgets_three_times_and_gives_up() {
    let mut watch = watch();
    let mut stalls = Vec::new();
    for tick in 0..100 {
        let cut_off = guidance(GuidanceStatus::Unreachable, watch.epoch());
        let pose = pose(f64::from(tick) * 0.5, f64::from(tick));
        stalls.extend(watch.step(&pose, &cut_off, false, false).map(|stall| parts(&stall)));
        if matches!(stalls.last(), Some((_, RecoveryStep::GiveUp, _))) {
            break;
        }
    }
    let cause = StallCause::CutOff;
    let want = [
        (cause, RecoveryStep::Reset, 1),
        (cause, RecoveryStep::Reset, 2),
        (cause, RecoveryStep::Reset, 3),
        (cause, RecoveryStep::GiveUp, 3),
    ];
    assert_eq!(stalls, want);
}

#[test]
fn a_robot_cut_off_by_the_evidential_method_looks_around_before_its_belief_is_blamed() {
    let path = std::path::Path::new("test.toml");
    let mission = Mission::parse("target = [3, 0]", path).unwrap();
    let mut watch = StallWatch::new(&mission);
    let cut_off = guidance(GuidanceStatus::Unreachable, 0);
    let turning = |second: f64| PoseSample { heading_rad: second, ..pose(second, 0.0) };
    let turn = TAU / mission.hurry().look_rad_s;
    let first = (0..100)
        .map(f64::from)
        .find(|&second| watch.step(&turning(second), &cut_off, false, false).is_some());
    assert!(first > Some(turn) && first < Some(5.0 * turn), "{first:?}");
}

#[test]
fn a_scan_is_no_stall() {
    let mut watch = watch();
    let look = guidance(GuidanceStatus::Look, 0);
    for tick in 0..75 {
        let seconds = f64::from(tick) * 0.2;
        let scanning = PoseSample { heading_rad: seconds.sin(), ..pose(seconds, 0.0) };
        assert_eq!(watch.step(&scanning, &look, false, false), None);
    }
}

#[test]
fn an_answer_from_before_the_reset_does_not_reset_again() {
    let mut watch = watch();
    let old = guidance(GuidanceStatus::Unreachable, 0);
    watch.step(&pose(0.0, 0.0), &old, false, false);
    let reset = watch.step(&pose(1.0, 0.0), &old, false, false);
    let want = (StallCause::CutOff, RecoveryStep::Reset, 1);
    assert_eq!(reset.map(|stall| parts(&stall)), Some(want));
    assert_eq!(watch.step(&pose(2.5, 0.1), &old, false, false), None);
}

/// Move to and fro at one place for `seconds`.
fn rock(watch: &mut StallWatch, seconds: std::ops::Range<u32>) -> Vec<StallSample> {
    let along = guidance(GuidanceStatus::Along, 0);
    let rocking = seconds.filter_map(|second| {
        let seconds = f64::from(second);
        let rocking = PoseSample {
            x_m: 0.05 * seconds.sin(),
            heading_rad: seconds,
            ..pose(seconds, 0.05 * seconds)
        };
        watch.step(&rocking, &along, false, false)
    });
    rocking.collect()
}

#[test]
fn a_robot_that_moves_and_stays_where_it_is_gets_a_fresh_planner_twice_then_a_fresh_belief() {
    let cause = StallCause::Pinned;
    let want = [
        (cause, RecoveryStep::Replan, 0),
        (cause, RecoveryStep::Replan, 0),
        (cause, RecoveryStep::Reset, 1),
    ];
    let stalls: Vec<_> = rock(&mut watch(), 0..60).iter().map(parts).collect();
    assert_eq!(stalls, want);
}

#[test]
fn a_robot_that_circles_what_it_should_stand_on_is_pinned_and_one_that_crawls_to_it_is_not() {
    let path = std::path::Path::new("test.toml");
    let mission = Mission::parse("target = [3, 0]\nmethod = 'paper'", path).unwrap();
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
        let near = |distance_m| GuidanceSample { distance_m, ..guidance(GuidanceStatus::Along, 0) };
        let stalls = [
            circling.step(&circle, &near(3.0 - circle.x_m), false, false),
            crawling.step(&crawl, &near(0.5 - crawl.x_m), false, false),
        ];
        for (first, stall) in seen.iter_mut().zip(stalls) {
            *first = first.or(stall.map(|stall| stall.cause()));
        }
    }
    assert_eq!(seen, [Some(StallCause::Pinned), None]);
}

#[test]
fn a_place_that_was_left_does_not_count() {
    let mut watch = watch();
    assert_eq!(rock(&mut watch, 0..40).len(), 2);
    let elsewhere = PoseSample { x_m: 1.0, ..pose(40.0, 3.0) };
    watch.step(&elsewhere, &guidance(GuidanceStatus::Along, 0), false, false);
    let recoveries: Vec<_> = rock(&mut watch, 41..85).iter().map(StallSample::recovery).collect();
    assert_eq!(recoveries, [RecoveryStep::Replan, RecoveryStep::Replan]);
    assert_eq!(watch.recoveries(None).0, 4);
}

#[test]
fn a_robot_that_drives_far_in_hazard_forgets_and_one_that_gets_out_does_not() {
    let way_out = guidance(GuidanceStatus::WayOut, 0);
    let drive = |watch: &mut StallWatch, metres: std::ops::Range<u32>| {
        let mut driving = metres.map(|tenths| PoseSample {
            x_m: f64::from(tenths) * 0.1,
            ..pose(f64::from(tenths), f64::from(tenths) * 0.1)
        });
        let stall = driving.find_map(|pose| watch.step(&pose, &way_out, false, false));
        stall.map(|stall| parts(&stall))
    };
    let want = (StallCause::InsideHazard, RecoveryStep::Reset, 1);
    assert_eq!(drive(&mut watch(), 0..12), Some(want));
    let mut watch = watch();
    assert_eq!(drive(&mut watch, 0..8), None);
    let out = PoseSample { x_m: 0.8, ..pose(8.0, 0.8) };
    watch.step(&out, &guidance(GuidanceStatus::Along, 0), false, false);
    assert_eq!(drive(&mut watch, 9..17), None);
}

#[test]
fn a_car_that_circles_on_its_tightest_circle_is_pinned_and_the_reason_names_the_radius() {
    let path = std::path::Path::new("test.toml");
    let mission = Mission::parse("target = [3, 0]\nrobot.model = 'car'", path).unwrap();
    let mut watch = StallWatch::new(&mission);
    let radius = mission.body().ackermann().unwrap().least_turning_radius();
    let along = guidance(GuidanceStatus::Along, 0);
    let stall = (0..600).map(f64::from).find_map(|tick| {
        let (seconds, travelled) = (tick / 7.0, tick / 7.0 * 0.125);
        let turned = travelled / radius;
        let circling = PoseSample {
            x_m: radius * turned.sin(),
            y_m: radius * (1.0 - turned.cos()),
            heading_rad: turned,
            ..pose(seconds, travelled)
        };
        watch.step(&circling, &along, false, false)
    });
    let cause = stall.map(|stall| stall.cause());
    assert_eq!(cause, Some(StallCause::Pinned));
    let reason = words(StallCause::Pinned, &mission.body());
    assert!(reason.contains("turns in no less than 0.31 m"), "{reason}");
    let x80 = Mission::parse("target = [3, 0]", path).unwrap();
    assert!(!words(StallCause::Pinned, &x80.body()).contains("turns in no less"));
}

#[test]
fn held_wheels_get_a_fresh_planner_at_once_and_again_elsewhere_and_are_held_fast_at_last() {
    use RecoveryStep::{GiveUp, Replan, Reset};
    let mut watch = watch();
    let held = |watch: &mut StallWatch, second: u32, x_m: f64| {
        let pose = PoseSample { x_m, ..pose(f64::from(second), x_m) };
        // The planner has no field yet.
        let stall = watch.step(&pose, &guidance(GuidanceStatus::Waiting, 0), false, true);
        parts(&stall.unwrap())
    };
    for second in 0..4 {
        let here = held(&mut watch, second, f64::from(second));
        assert_eq!(here, (StallCause::Held, Replan, 0));
    }
    let mut steps = Vec::new();
    while steps.last() != Some(&GiveUp) {
        let second = 10 + steps.len() as u32;
        // The robot turns about a blocked wheel.
        steps.push(held(&mut watch, second, 10.0 + 0.2 * f64::from(second % 2)).1);
    }
    let round = [Replan, Replan, Reset];
    assert_eq!(steps, [&round[..], &round, &round, &[Replan, Replan, GiveUp]].concat());
    let body = Mission::parse("target = [3, 0]", std::path::Path::new("m.toml")).unwrap().body();
    assert!(words(watch.gave_up().unwrap().cause(), &body).contains("held fast"));
}

#[test]
fn a_robot_that_drives_three_times_as_far_as_its_target_was_away_forgets_and_in_the_end_gives_up() {
    let stalls = |method: &str, target_m: f64| {
        let text = format!("target = [3, 0]\nmethod = '{method}'");
        let mission = Mission::parse(&text, std::path::Path::new("test.toml")).unwrap();
        let mut watch = StallWatch::new(&mission);
        let mut stalls = Vec::new();
        for metre in (0..200).map(f64::from) {
            let along = GuidanceSample {
                distance_m: target_m,
                ..guidance(GuidanceStatus::Along, watch.epoch())
            };
            let pose = PoseSample { x_m: metre % 2.0, ..pose(2.0 * metre, metre) };
            if let Some(stall) = watch.step(&pose, &along, false, false) {
                stalls.push((metre, stall.cause(), stall.recovery()));
                if stall.recovery() == RecoveryStep::GiveUp {
                    break;
                }
            }
        }
        stalls
    };
    let at = |metre, recovery| (metre, StallCause::Wandering, recovery);
    let want = [
        at(24.0, RecoveryStep::Reset),
        at(49.0, RecoveryStep::Reset),
        at(74.0, RecoveryStep::Reset),
        at(99.0, RecoveryStep::GiveUp),
    ];
    assert_eq!(stalls("evidential", 8.0), want);
    assert_eq!(stalls("evidential", 1.0)[0], at(12.0, RecoveryStep::Reset));
    assert_eq!(stalls("paper", 8.0), []);
}

#[test]
fn a_robot_with_a_laser_wanders_where_it_has_been_and_not_where_it_has_not() {
    let text = "target = [3, 0]\nrobot.model = 'kobuki'";
    let mission = Mission::parse(text, std::path::Path::new("test.toml")).unwrap();
    let first = |x_m: fn(f64) -> f64| {
        let mut watch = StallWatch::new(&mission);
        (0..200).find(|&metre| {
            let metre = f64::from(metre);
            let pose = PoseSample { x_m: x_m(metre), ..pose(2.0 * metre, metre) };
            let guidance = GuidanceSample { distance_m: 3.0, ..guidance(GuidanceStatus::Along, 0) };
            watch.step(&pose, &guidance, false, false).is_some()
        })
    };
    assert_eq!(first(|metre| metre), None);
    // The limit is 12 m, and 3 m for each of four squares.
    assert_eq!(first(|metre| metre % 4.0), Some(24));
}

#[test]
fn a_relocated_robot_forgets_all_of_its_map_each_time_and_gives_up_for_it_never() {
    let mut watch = watch();
    let along = guidance(GuidanceStatus::Along, 0);
    let mut resets = Vec::new();
    for second in 0..20 {
        let place = f64::from(second);
        let relocations = u64::from(second as u32 / 3);
        let pose = PoseSample { relocations, x_m: place, ..pose(place, place) };
        resets.extend(watch.step(&pose, &along, false, false).map(|stall| parts(&stall)));
    }
    // Only in an even epoch the mapper resets the evidence near the robot.
    let want =
        [2, 4, 6, 8, 10, 12].map(|epoch| (StallCause::Relocated, RecoveryStep::Reset, epoch));
    assert_eq!(resets, want);
    assert_eq!(watch.recoveries(None), (0, 6));
    let cut_off = guidance(GuidanceStatus::Unreachable, watch.epoch());
    let stalls = (20..30).filter_map(|second| {
        let pose = PoseSample { relocations: 6, ..pose(f64::from(second), f64::from(second)) };
        watch.step(&pose, &cut_off, false, false)
    });
    assert_eq!(stalls.map(|stall| stall.recovery()).next(), Some(RecoveryStep::Reset));
}
