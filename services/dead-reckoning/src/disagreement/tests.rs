use common::clock::MissionTime;
use glam::DVec2;

use super::*;

const PERIOD_S: f64 = 0.1;
const TRACK_M: f64 = 0.26;

/// Deviations from stated parameters.
#[derive(Clone, Copy, Debug)]
struct Robot {
    late_s: f64,
    turned_rad: f64,
    /// Sign of what a laser sees to the left.
    left: f64,
    /// True over wheels' distance and turn.
    way: f64,
    turn: f64,
    /// Right over left travel, for equal counts.
    uneven: f64,
    /// Every tenth second the wheels report twice their travel.
    slips: bool,
}

const RIGHT: Robot = Robot {
    late_s: 0.0,
    turned_rad: 0.0,
    left: 1.0,
    way: 1.0,
    turn: 1.0,
    uneven: 1.0,
    slips: false,
};

fn named(robot: Robot, seed: u64, for_s: f64) -> Option<(f64, Cause)> {
    let mut state = seed;
    let mut random = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1 << 24) - 0.5
    };
    (0..9).for_each(|_| {
        random();
    });
    let mut disagreement = Disagreement::default();
    let mut ticks = VecDeque::new();
    let mut poses = vec![Pose2::default()];
    let mut speeds = [0.0; 2];
    let mut wanted = [0.0; 2];
    let mut changes_s = 0.0;
    for step in 1..(for_s / PERIOD_S) as u64 {
        let now = step as f64 * PERIOD_S;
        if now > changes_s {
            changes_s = now + 1.5 + random();
            wanted = if random() > 0.2 { [0.0, 1.2 * random()] } else { [0.35, 0.8 * random()] };
        }
        for (speed, wanted) in speeds.iter_mut().zip(wanted) {
            *speed += 0.3 * (wanted - *speed);
        }
        let [arc, turn] = speeds.map(|speed| speed * PERIOD_S);
        let more = if robot.slips && (now as u64).is_multiple_of(10) { 2.0 } else { 1.0 };
        ticks.push_back(Tick {
            time: MissionTime::from_seconds(now),
            seconds: PERIOD_S,
            arc: arc * more * (1.0 + 0.05 * random()),
            turn: turn * (1.0 + 0.05 * random()),
            ..Tick::default()
        });
        if ticks.len() > 20 {
            ticks.pop_front();
        }
        let before = poses[poses.len() - 1];
        let bend = arc * (robot.uneven - 1.0) / TRACK_M;
        poses.push(before.along_arc(arc * robot.way, turn * robot.turn + bend));
        let late = (robot.late_s / PERIOD_S).round() as usize;
        let Some(seen) = poses.iter().rev().nth(late) else {
            continue;
        };
        // To a laser turned left, the robot's frame is turned right.
        let position = DVec2::new(1.0, robot.left) * seen.position;
        let fix = Fix {
            time: MissionTime::from_seconds(now),
            position: DVec2::from_angle(-robot.turned_rad).rotate(position)
                + 0.006 * DVec2::new(random(), random()),
            heading: Some(robot.left * seen.heading + 0.003 * random()),
            covariance: [1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4],
            shared: [1e-5, 1e-6],
        };
        if let Some(cause) = disagreement.compare(&fix, &ticks, TRACK_M) {
            return Some((now, cause));
        }
    }
    None
}

#[test]
fn a_late_a_turned_and_a_mirrored_laser_and_wrong_wheels_are_named_within_half_a_minute() {
    let is = |robot: Robot, right: &dyn Fn(Cause) -> bool| {
        for seed in 0..40 {
            let found = named(robot, seed, 60.0);
            assert!(
                found.is_some_and(|(at, cause)| at < 30.0 && right(cause)),
                "{robot:?} {seed}: {found:?}"
            );
        }
    };
    for late_s in [0.1, 0.2, 0.3] {
        let near = |cause| matches!(cause, Cause::Late(by) if (by - late_s).abs() < 0.05);
        is(Robot { late_s, ..RIGHT }, &near);
    }
    for turned_rad in [-0.3, -0.09, 0.12, 0.5] {
        let near = |cause| matches!(cause, Cause::Turned(by) if (by - turned_rad).abs() < 0.05);
        is(Robot { turned_rad, ..RIGHT }, &near);
    }
    is(Robot { left: -1.0, ..RIGHT }, &|cause| cause == Cause::Mirrored);
    for uneven in [0.94, 1.1] {
        let near = |cause| matches!(cause, Cause::Uneven(it) if (it - uneven).abs() < 0.02);
        is(Robot { uneven, ..RIGHT }, &near);
    }
    for factor in [0.8, 1.3] {
        let near = |found: f64| (found - factor).abs() < 0.08;
        is(Robot { way: factor, ..RIGHT }, &|cause| matches!(cause, Cause::Way(it) if near(it)));
        is(Robot { turn: factor, ..RIGHT }, &|cause| matches!(cause, Cause::Turn(it) if near(it)));
    }
}

#[test]
fn nothing_is_named_on_a_right_robot_though_its_wheels_slip_now_and_then() {
    for seed in 0..100 {
        for slips in [false, true] {
            let robot = Robot { slips, way: 1.03, turn: 0.95, turned_rad: 0.02, ..RIGHT };
            assert_eq!(named(robot, seed, 300.0), None, "{seed} {slips}");
        }
    }
}
