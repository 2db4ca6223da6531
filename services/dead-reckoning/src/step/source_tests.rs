//! Tests of fixes and a gyro with a robot of known errors.

use super::{tests::reckoning_of, *};
use common::samples::{FixSample, Stamp, TurnSample};
use glam::dvec2;

const TICK_NS: u64 = 100_000_000;
const FIVE_CM: [f64; 6] = [25e-4, 0.0, 0.0, 25e-4, 0.0, 4e-4];

#[derive(Default)]
struct Robot {
    truth: Pose2,
    larger: f64,
    counts: [f64; 2],
    tick: u64,
    seed: u64,
    told_ratio: f64,
    untold_m: [f64; 2],
}

impl Robot {
    fn new(larger: f64) -> Self {
        Self { larger, seed: 7, told_ratio: 1.0, ..Self::default() }
    }

    fn drive(&mut self, arc: f64, turn: f64) -> WheelSample {
        let (track, per_metre) = (0.26, 1200.0 / (std::f64::consts::TAU * 0.085));
        self.truth = self.truth.along_arc(arc, turn);
        for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
            let way = arc + sign * turn * track / 2.0;
            self.counts[side] += way / (1.0 + sign * self.larger / 2.0) * per_metre;
        }
        self.tick += 1;
        let [left_counts, right_counts] =
            self.counts.map(|counts| (counts.round() as i64).rem_euclid(32_768) as u16);
        let stamp = Stamp { tick: self.tick, stamp_ns: self.tick * TICK_NS, ..Stamp::default() };
        WheelSample {
            stamp,
            left_counts,
            right_counts,
            told_ratio: self.told_ratio,
            told_ratio_sd: 0.006,
            untold_m: self.untold_m,
            ..WheelSample::default()
        }
    }

    fn wind(&mut self) -> WheelSample {
        let turn = 0.06 * (self.tick as f64 / 15.0).sin();
        self.drive(0.04, turn)
    }

    fn noise(&mut self) -> f64 {
        let mut even = || {
            self.seed = self.seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (self.seed >> 33) as f64 / f64::from(1u32 << 31)
        };
        (0..12).map(|_| even()).sum::<f64>() - 6.0
    }

    /// Returns a fix off by 5 cm.
    fn fix(&mut self) -> FixSample {
        let at = self.truth.position + dvec2(self.noise(), self.noise()) * 0.05;
        FixSample {
            capture_ns: self.tick * TICK_NS,
            x_m: at.x,
            y_m: at.y,
            heading_rad: f64::NAN,
            covariance: FIVE_CM,
            ..FixSample::default()
        }
    }

    fn headed_fix(&mut self) -> FixSample {
        FixSample { heading_rad: self.truth.heading, ..self.fix() }
    }

    fn error_m(&self, pose: &PoseSample) -> f64 {
        self.truth.position.distance(pose.pose().position)
    }
}

fn x80() -> DeadReckoning {
    reckoning_of("target = [3, 0]")
}

struct Run {
    robot: Robot,
    reckoning: DeadReckoning,
}

fn run(larger: f64) -> Run {
    Run { robot: Robot::new(larger), reckoning: x80() }
}

impl Run {
    /// Winds for `ticks` with fixes of `source`. Returns what is reckoned, and its errors, metres.
    fn wind(
        &mut self,
        ticks: u64,
        mut source: impl FnMut(&mut Robot) -> Vec<FixSample>,
    ) -> Vec<(Reckoned, f64)> {
        let tick = |_| {
            let wheels = self.robot.wind();
            let fixes = source(&mut self.robot);
            let reckoned = self.reckoning.given(&wheels, &fixes, &[]);
            let error_m = self.robot.error_m(&reckoned.pose);
            (reckoned, error_m)
        };
        (0..ticks).map(tick).collect()
    }

    fn rms(&mut self, ticks: u64, source: impl FnMut(&mut Robot) -> Vec<FixSample>) -> f64 {
        let squares = self.wind(ticks, source).into_iter().map(|(_, error_m)| error_m.powi(2));
        (squares.sum::<f64>() / ticks as f64).sqrt()
    }

    fn deviation_m(&self) -> f64 {
        self.reckoning.sample().covariance[3].sqrt()
    }
}

fn each_second(robot: &mut Robot) -> Vec<FixSample> {
    let fix = robot.fix();
    if robot.tick.is_multiple_of(10) { vec![fix] } else { Vec::new() }
}

fn moved(fix: FixSample, by: DVec2) -> FixSample {
    FixSample { x_m: fix.x_m + by.x, y_m: fix.y_m + by.y, ..fix }
}

#[test]
fn a_tick_that_is_given_again_takes_no_fixes_so_that_the_next_one_has_them() {
    let mut reckoning = x80();
    let wheels = Robot::new(0.0).wind();
    assert!(!reckoning.has_answered(&wheels));
    reckoning.answer(&wheels, &Sources::default(), wheels.stamp.time());
    assert!(reckoning.has_answered(&wheels));
    let next = WheelSample { stamp: Stamp { tick: 2, ..wheels.stamp }, ..wheels };
    assert!(!reckoning.has_answered(&next));
}

#[test]
fn fixes_hold_the_pose_of_a_robot_with_unequal_wheels_and_teach_their_ratio() {
    let none = |_: &mut Robot| Vec::new();
    let off = run(0.005).rms(600, none);
    let mut run = run(0.005);
    let on = run.rms(600, each_second);
    assert!(on < 0.06 && off > 1.0, "{on} with fixes, {off} without");
    // By now the wheels are known.
    let sure = run.reckoning.sample().covariance;
    let later = run.rms(300, none);
    assert!(later < 0.15, "{later} afterwards, {on} with fixes, {off} without");
    let silent = run.reckoning.sample().covariance;
    assert!([0, 3, 5].into_iter().all(|entry| silent[entry] > sure[entry]));
}

#[test]
fn no_number_of_fixes_makes_the_pose_surer_than_the_error_that_they_share() {
    let mut run = run(0.005);
    let sharing = |robot: &mut Robot| vec![FixSample { shared: [0.04, 0.0], ..robot.fix() }];
    run.wind(200, sharing);
    assert!((run.deviation_m() - 0.2).abs() < 0.01);
    run.wind(200, |robot| vec![robot.fix()]);
    assert!(run.deviation_m() < 0.05, "fixes of another source do");
    let before = run.reckoning.sample().fixes;
    run.wind(1, sharing);
    assert_eq!(run.reckoning.sample().fixes, before + 1, "and those of the first stay in use");
}

#[test]
fn a_fix_that_comes_late_counts_as_if_it_had_come_at_once() {
    let (mut robot, mut prompt, mut late) = (Robot::new(0.005), x80(), x80());
    let mut waiting = Vec::new();
    for tick in 0..200u64 {
        let wheels = robot.wind();
        let fix = robot.fix();
        prompt.given(&wheels, if tick % 10 == 3 { std::slice::from_ref(&fix) } else { &[] }, &[]);
        waiting.extend((tick % 10 == 3).then_some(fix));
        let due = if tick % 10 == 9 { std::mem::take(&mut waiting) } else { Vec::new() };
        let taken = late.given(&wheels, &due, &[]);
        assert_eq!(taken.refused, None, "tick {tick}");
        if tick % 10 == 9 {
            assert_eq!(late.state().history, prompt.state().history, "tick {tick}");
        }
    }
    assert_eq!(late.state().fixes, 20);
}

#[test]
fn the_pose_follows_a_fix_without_tearing_the_map_and_odometry_does_not_jump() {
    let Run { mut robot, mut reckoning } = run(0.0);
    let mut before = reckoning.given(&robot.wind(), &[], &[]).pose;
    // Counts are lost in motion, so the pose may be off.
    let lost = WheelSample { restarts: 1, ..robot.drive(0.0, 0.0) };
    robot.truth.position += dvec2(0.1, 0.08);
    reckoning.given(&lost, &[], &[]);
    let mut reached = false;
    for tick in 0..40 {
        let wheels = WheelSample { restarts: 1, ..robot.drive(0.03, 0.0) };
        let fix = robot.headed_fix();
        let pose = reckoning.given(&wheels, &[fix], &[]).pose;
        let moved = before.pose().position.distance(pose.pose().position);
        let by_wheels = pose.odometry().position.distance(before.odometry().position);
        let turned = (pose.heading_rad - before.heading_rad).abs().to_degrees();
        assert!(moved < 0.051 && by_wheels < 0.031 && turned < 1.1, "{moved} {by_wheels} {turned}");
        reached |= tick > 5 && robot.error_m(&pose) < 0.05;
        before = pose;
    }
    assert!(reached && before.map_from_odom != [0.0; 3], "{before:?}");
}

#[test]
fn one_fix_in_twenty_that_is_off_by_a_metre_does_no_harm() {
    let mut run = run(0.005);
    let mut count = 0;
    let on = run.rms(1000, |robot| {
        let spoil = |fix| {
            count += 1;
            let off_m = f64::from(u8::from(count % 20 == 0));
            moved(fix, DVec2::from_angle(f64::from(count)) * off_m)
        };
        each_second(robot).into_iter().map(spoil).collect()
    });
    assert!(on < 0.07, "{on}");
    let state = run.reckoning.state();
    assert_eq!((state.fixes_refused, state.relocations), (5, 0));
}

#[test]
fn a_fix_that_cannot_be_used_is_refused_with_its_cause() {
    use FixRefusal::{Covariance, Far, Future, Late, NotFinite};
    type Spoil = fn(&mut FixSample);
    let rows: [(FixRefusal, Spoil); 10] = [
        (FixRefusal::None, |_| {}),
        (FixRefusal::None, |fix| (fix.heading_rad, fix.covariance[5]) = (f64::NAN, f64::NAN)),
        (Late, |fix| fix.capture_ns -= 21 * TICK_NS),
        (Future, |fix| fix.capture_ns += 2 * TICK_NS),
        (NotFinite, |fix| fix.x_m = f64::INFINITY),
        (NotFinite, |fix| fix.covariance[5] = f64::NAN),
        (Covariance, |fix| fix.covariance[0] = 24e-6),
        (Covariance, |fix| fix.covariance[1] = 26e-4),
        (Covariance, |fix| fix.covariance[5] = 0.0),
        (Far, |fix| fix.y_m += 1.0),
    ];
    for (want, spoil) in rows {
        let mut run = run(0.0);
        run.wind(50, each_second);
        let Run { mut robot, mut reckoning } = run;
        let wheels = robot.wind();
        let mut fix = robot.headed_fix();
        spoil(&mut fix);
        let used = reckoning.state().fixes;
        let reckoned = reckoning.given(&wheels, &[fix], &[]);
        let refused = (want != FixRefusal::None).then_some(want);
        assert_eq!(reckoned.refused, refused, "{fix:?}");
        assert_eq!(reckoned.pose.refusal, u8::from(want));
        assert_eq!(reckoned.pose.fixes - used, u64::from(refused.is_none()));
    }
}

#[test]
fn fixes_that_agree_for_three_seconds_relocate_a_robot_that_was_carried() {
    // The robot is carried after 10 s, and seen for 20 s.
    let relocations = |source: fn(&mut Robot) -> FixSample| {
        let mut run = run(0.0);
        run.wind(100, each_second);
        let heading = run.robot.truth.heading + 1.9;
        run.robot.truth = Pose2 { position: dvec2(-2.0, 3.0), heading };
        let all = run.wind(200, |robot| vec![source(robot)]).into_iter().enumerate();
        let relocated = |(tick, (reckoned, error)): (usize, (Reckoned, f64))| {
            reckoned.relocated.then_some((tick / 10, error))
        };
        Vec::from_iter(all.filter_map(relocated))
    };
    for relocated in [relocations(Robot::fix), relocations(Robot::headed_fix)] {
        let [(3, error)] = relocated[..] else { panic!("{relocated:?}") };
        assert!(error < 0.15, "{error}");
    }
    let scattered =
        relocations(|robot| moved(robot.fix(), DVec2::from_angle(robot.tick as f64) * 2.0));
    assert_eq!(scattered, []);
}

#[test]
fn a_robot_that_was_carried_is_relocated_by_a_camera_while_its_scans_match_its_old_map() {
    let (mut run, aside) = (run(0.0), dvec2(0.0, 2.0));
    run.wind(100, each_second);
    run.robot.truth.position += aside;
    let by_both = |robot: &mut Robot| {
        let scan = FixSample { shared: [1e-6; 2], ..moved(robot.headed_fix(), -aside) };
        vec![robot.fix(), scan]
    };
    let all = run.wind(40, by_both);
    assert!(all.iter().any(|(reckoned, _)| reckoned.relocated));
}

#[test]
fn a_source_that_is_aside_moves_the_robot_no_farther_than_it_is_and_the_pose_keeps_the_doubt() {
    for aside_m in [0.3, 1.0, 3.0] {
        let mut run = run(0.0);
        let all = run.wind(600, |robot| vec![moved(robot.fix(), dvec2(0.0, aside_m))]);
        let worst = all.into_iter().map(|(_, error_m)| error_m).fold(0.0, f64::max);
        assert_eq!(run.reckoning.sample().relocations, 1, "{aside_m}");
        assert!(worst < 1.2 * aside_m + 0.1, "{worst} by a source {aside_m} aside");
        let deviation = run.deviation_m();
        assert!(deviation > 0.8 * aside_m, "{deviation} by a source {aside_m} aside");
    }
}

#[test]
fn a_source_that_contradicts_itself_moves_the_robot_twice_and_is_then_refused() {
    let all = run(0.0).wind(1200, |robot| {
        let aside_m = [0.0, 3.0][(robot.tick - 1) as usize / 100 % 2];
        vec![moved(robot.fix(), dvec2(0.0, aside_m))]
    });
    assert_eq!(all.iter().filter(|(reckoned, _)| reckoned.relocated).count(), 2);
    assert!(all.iter().any(|(reckoned, _)| reckoned.refused == Some(FixRefusal::Contradicts)));
}

#[test]
fn wheels_that_count_unequal_shares_of_what_they_are_told_make_the_pose_unsure_until_another_source_places_it()
 {
    let deviation = |told_ratio: f64, untold_m: [f64; 2], by_others: bool| {
        let mut run = run(0.0);
        (run.robot.told_ratio, run.robot.untold_m) = (told_ratio, untold_m);
        let fixes = |robot: &mut Robot| if by_others { vec![robot.fix()] } else { Vec::new() };
        let all = run.wind(80, fixes);
        let told = all.iter().filter(|(reckoned, _)| reckoned.doubted.is_some()).count();
        (run.deviation_m(), told)
    };
    let (even, _) = deviation(1.01, [0.0; 2], false);
    // In none of 20 missions with an encoder 5 % low is it nearer to 1.
    let (uneven, told) = deviation(0.965, [0.0; 2], false);
    assert!(even < 0.15 && uneven > 0.5 && told == 1, "{even} and {uneven}, told {told} times");
    // An encoder 4 % low for half a short mission.
    assert!(deviation(1.02, [0.0; 2], false).0 > 0.25);
    // A wheel's counts, and those of both, jump.
    assert!(deviation(1.0, [0.08, 0.0], false).0 > 0.5);
    assert!(deviation(1.0, [0.6; 2], false).0 > 0.5);
    assert!(deviation(0.965, [0.08, 0.0], true).0 < 0.1);
}

#[test]
fn a_pushed_robot_is_where_its_scans_match() {
    let mut run = run(0.0);
    let scan = |robot: &mut Robot| vec![FixSample { shared: [1e-6; 2], ..robot.headed_fix() }];
    run.wind(40, scan);
    run.robot.truth.position += dvec2(0.3, 0.0);
    run.robot.truth.heading += 0.15;
    let (reckoned, error_m) = run.wind(1, scan).remove(0);
    assert!(reckoned.refused.is_none() && error_m < 0.2, "{reckoned:?} {error_m}");
    assert!(run.deviation_m() > 0.5 * error_m, "{} {error_m}", run.deviation_m());
}

#[test]
fn a_doubt_of_the_wheels_is_settled_by_a_scan_that_says_where_the_robot_is_and_by_no_other() {
    for (own, is_settled) in [
        ([0.05, 0.03], true),
        // An empty hall, and a round room.
        ([0.3, 0.03], false),
        ([0.05, 0.2], false),
    ] {
        let mut run = run(0.0);
        run.robot.told_ratio = 0.965;
        run.wind(80, |robot| {
            // All fixes share 1 cm and 0.01 rad.
            let [place, heading] = own.map(|own: f64| own * own + 1e-4);
            vec![FixSample {
                covariance: [place, 0.0, 0.0, place, 0.0, heading],
                shared: [1e-4; 2],
                ..robot.headed_fix()
            }]
        });
        let deviation = run.deviation_m();
        assert!(if is_settled { deviation < 0.1 } else { deviation > 0.5 }, "{own:?} {deviation}");
    }
}

/// Drives a robot with `gyro`, which gets ticks and increments. Returns the last and the greatest
/// heading error.
fn heading_errors(
    mut robot: Robot,
    ticks: u64,
    mut drive: impl FnMut(&mut Robot) -> WheelSample,
    mut gyro: impl FnMut(u64, f64) -> Vec<TurnSample>,
) -> [f64; 2] {
    let (mut reckoning, mut turned, mut last, mut greatest) = (x80(), 0.0, 0.0, 0.0_f64);
    for _ in 0..ticks {
        let wheels = drive(&mut robot);
        let increment = robot.truth.heading - turned;
        turned = robot.truth.heading;
        let pose = reckoning.given(&wheels, &[], &gyro(robot.tick, increment)).pose;
        last = pose.heading_rad - robot.truth.heading;
        greatest = greatest.max(last.abs());
    }
    [last, greatest]
}

/// Returns the heading error after 20 s of rest and 60 s of driving with a biased gyro.
fn heading_error(bias: f64, mut gyro: impl FnMut(u64, f64) -> Vec<TurnSample>) -> f64 {
    let drive =
        |robot: &mut Robot| if robot.tick < 200 { robot.drive(0.0, 0.0) } else { robot.wind() };
    heading_errors(Robot::new(0.01), 800, drive, |tick, by| gyro(tick, by + bias * 0.1))[0]
}

fn turn(tick: u64, turn_rad: f64) -> TurnSample {
    TurnSample {
        capture_ns: tick * TICK_NS,
        sequence: tick,
        turn_rad,
        variance_rad2: 1e-8,
        ..TurnSample::default()
    }
}

#[test]
fn a_gyro_whose_increments_come_after_their_ticks_have_left_the_history_does_no_harm() {
    // The source pauses for 4 s repeatedly, while the robot circles.
    let mut waiting = Vec::new();
    let gyro = |tick: u64, increment| {
        waiting.push(turn(tick, increment));
        if tick.is_multiple_of(40) { std::mem::take(&mut waiting) } else { Vec::new() }
    };
    let [_, off] = heading_errors(Robot::new(0.0), 400, |robot| robot.drive(0.04, 0.03), gyro);
    assert!(off < 0.1, "{off}");
}

#[test]
fn a_gyro_holds_the_heading_and_its_bias_is_learned_at_rest() {
    let without = heading_error(0.0, |_, _| Vec::new());
    let with = heading_error(0.01, |tick, increment| vec![turn(tick, increment)]);
    assert!(without.abs() > 0.5 && with.abs() < 0.01, "{with} with a gyro, {without} without");
    // Three ticks late, two at a time, one in ten lost.
    let mut waiting = Vec::new();
    let late = heading_error(0.01, |tick, increment| {
        waiting.extend((tick % 10 != 5).then(|| turn(tick, increment)));
        let due = if tick.is_multiple_of(2) { waiting.len().saturating_sub(3) } else { 0 };
        waiting.drain(..due).collect()
    });
    assert!(late.abs() < 0.2 * without.abs(), "{late}");
    // Ends between the ticks.
    let mut before = 0.0;
    let between = heading_error(0.01, |tick, increment| {
        let half = 0.5 * (before + increment);
        before = increment;
        vec![TurnSample { capture_ns: tick * TICK_NS - TICK_NS / 2, ..turn(tick, half) }]
    });
    assert!(between.abs() < 0.03, "{between}");
    let broken = heading_error(0.0, |tick, _| vec![turn(tick, f64::NAN)]);
    assert_eq!(broken, without);
}

#[test]
fn a_gyro_that_contradicts_the_wheels_makes_the_pose_unsure_even_after_it_ends() {
    // 4 s straight ahead, 2 s with `says` rad per tick, then 4 s without a gyro.
    let deviation = |says: f64| {
        let (mut robot, mut reckoning) = (Robot::new(0.0), x80());
        for tick in 0..100 {
            let wheels = robot.drive(0.0267, 0.0);
            let said = if tick < 40 { 0.0 } else { says };
            let turns = if tick < 60 { vec![turn(robot.tick, said)] } else { Vec::new() };
            reckoning.given(&wheels, &[], &turns);
        }
        reckoning.sample().position_rms_m()
    };
    let agrees = deviation(0.0);
    assert!(agrees < 0.2, "{agrees}");
    // 0.6 rad over more than 1 m.
    let contradicts = deviation(0.03);
    assert!(contradicts > 0.6, "{contradicts}");
}

#[test]
fn what_counts_leave_open_is_not_taken_for_a_gyros_bias() {
    // Drives, stands, turns, drives; readings are off by half a count.
    let drive = |robot: &mut Robot| {
        let ways = [(0.04, 0.02), (0.0, 0.0), (0.0, -0.25), (0.05, 0.0)];
        let (arc, rate) = ways[robot.tick as usize / 5 % 4];
        let mut wheels = robot.drive(arc, rate);
        for counts in [&mut wheels.left_counts, &mut wheels.right_counts] {
            let read = f64::from(*counts) + 0.5 * robot.noise();
            *counts = read.round().rem_euclid(32_768.0) as u16;
        }
        wheels
    };
    for seed in 1..=20 {
        let robot = Robot { seed, ..Robot::new(0.0) };
        let [off, _] = heading_errors(robot, 200, drive, |tick, by| vec![turn(tick, by)]);
        assert!(off.abs() < 0.03, "{seed}: {off}");
    }
}

#[test]
fn a_state_that_is_restored_between_fixes_goes_on_to_the_bit_and_fits_its_file() {
    let (mut robot, mut whole, mut killed) = (Robot::new(0.01), x80(), x80());
    let mut longest = 0;
    for tick in 0..300u64 {
        let wheels = robot.wind();
        let fixes = [(); 4].map(|()| robot.fix());
        let poses = [&mut whole, &mut killed].map(|one| one.given(&wheels, &fixes, &[]).pose);
        assert_eq!(poses[0], poses[1]);
        if tick % 7 == 0 {
            let bytes = postcard::to_extend(killed.state(), Vec::new()).unwrap();
            longest = longest.max(bytes.len());
            killed = x80();
            killed.restore(postcard::from_bytes(&bytes).unwrap()).unwrap();
        }
    }
    assert!(longest > 5_000 && longest < STATE_BYTES, "{longest}");
}

#[test]
fn an_operator_sets_the_pose_once_with_its_deviations_and_the_way_goes_on_from_there() {
    let mut run = run(0.0);
    run.wind(100, |_| Vec::new());
    let place = PlaceSample {
        number: 1,
        x_m: 7.0,
        y_m: -2.0,
        heading_rad: 3.0,
        sigma_m: 0.5,
        sigma_rad: 0.2,
        ..PlaceSample::default()
    };
    let sources = Sources { place: Some(place), ..Sources::default() };
    let mut reckoned = |arc| {
        let wheels = run.robot.drive(arc, 0.0);
        run.reckoning.reckon(&wheels, &sources, wheels.stamp.time())
    };
    let Reckoned { placed, pose, .. } = reckoned(0.0);
    assert_eq!((placed, pose.x_m, pose.y_m, pose.relocations), (true, 7.0, -2.0, 1));
    assert!((wrapped(pose.heading_rad - 3.0)).abs() < 1e-9, "{pose:?}");
    assert_eq!([pose.covariance[0], pose.covariance[3]], [0.25; 2]);
    assert!((pose.covariance[5] - 0.04).abs() < 1e-9, "{pose:?}");
    // A repeated place changes nothing.
    assert!(!reckoned(0.0).placed);
    let after = (0..25).map(|_| reckoned(0.04).pose).last().unwrap();
    let way = after.pose().position - dvec2(7.0, -2.0);
    assert!((way - DVec2::from_angle(3.0)).length() < 0.02, "{way}");
}

/// Winds with a camera each second, and a scan matcher that drifts aside.
fn beside_camera(run: &mut Run, ticks: u64) -> f64 {
    run.rms(ticks, |robot| {
        let fix = robot.fix();
        let matched = FixSample {
            heading_rad: robot.truth.heading,
            covariance: [0.11, 0.0, 0.0, 0.11, 0.0, 0.02],
            shared: [0.09, 0.01],
            ..moved(fix, dvec2(0.0, 0.002 * robot.tick as f64))
        };
        let camera = robot.tick.is_multiple_of(10).then_some(fix);
        camera.into_iter().chain([matched]).collect()
    })
}

#[test]
fn a_camera_holds_the_pose_whose_scan_matcher_drifts_farther_than_it_says_and_makes_it_sure() {
    let mut run = run(0.0);
    let [_, drifted] = [700, 100].map(|ticks| beside_camera(&mut run, ticks));
    let [xx, _, _, yy, ..] = run.reckoning.sample().covariance;
    assert!(xx.max(yy) < 0.02, "{xx} {yy}");
    // A turn that no wheel saw, as while a process is replaced: matcher fixes contradict the pose
    // for a while.
    run.robot.truth.heading += 0.55;
    let turned = beside_camera(&mut run, 100);
    assert!(drifted < 0.1 && turned < 0.15, "{drifted} m off, {turned} m after a turn");
    assert_eq!(run.reckoning.sample().relocations, 0);
}
