use std::{f64::consts::TAU, path::Path};

use common::{
    driver::range_reading,
    kinematics::Pose2,
    mission::{Mission, SensorKind},
    samples::ScanHeader,
};
use glam::DVec2;

use super::*;

const BEAMS: usize = 180;
const RATE_HZ: f64 = 10.0;

/// How a robot differs from what its mission says.
#[derive(Clone, Copy)]
struct Robot {
    yaw_rad: f64,
    mirrored: bool,
    late_s: f64,
    track: f64,
    wheel: f64,
    /// Which wheel each encoder follows, and in which direction it counts.
    encoders: [(usize, f64); 2],
    left_motor: f64,
    motors_swapped: bool,
    laser_m: f64,
}

const RIGHT: Robot = Robot {
    yaw_rad: 0.0,
    mirrored: false,
    late_s: 0.0,
    track: 1.0,
    wheel: 1.0,
    encoders: [(0, 1.0), (1, 1.0)],
    left_motor: 1.0,
    motors_swapped: false,
    laser_m: 0.05,
};

fn mission() -> Mission {
    let text = "target = [1, 0]\n[robot]\nmodel = 'kobuki'\nrate_hz = 10.0\n[[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nmodel = 'rplidar-a1'\nforward_m = 0.05\nbearing_deg = 0.0\nbeams = 180";
    Mission::parse(text, Path::new("m.toml")).unwrap()
}

/// Three sonars, and counts that only a driver knows.
fn with_sonars() -> Mission {
    let mut text = "target = [1, 0]\n[robot]\nmodel = 'x80'\nrate_hz = 10.0\n".to_owned();
    for (channel, bearing) in [(0, 0), (1, 40), (2, -40)] {
        text += &format!(
            "[[robot.sensor]]\nname = 'sonar{channel}'\nkind = 'cone'\nchannel = {channel}\nforward_m = 0.1\nbearing_deg = {bearing}\n"
        );
    }
    Mission::parse(&text, Path::new("m.toml")).unwrap()
}

/// Range from `at` along `along` in a room whose walls stand 1.4 m ahead, 1.9 m behind, 1.6 m to the left and 1.2 m to the right.
fn range(at: DVec2, along: DVec2) -> f64 {
    let walls = [
        (1.4, at.x, along.x),
        (1.9, -at.x, -along.x),
        (1.6, at.y, along.y),
        (1.2, -at.y, -along.y),
    ];
    let ends =
        walls.into_iter().filter(|wall| wall.2 > 1e-9).map(|(wall, at, along)| (wall - at) / along);
    ends.fold(f64::INFINITY, f64::min)
}

/// The trace of `robot` in the room; without lag or noise.
fn trace(mission: &Mission, robot: Robot) -> Trace {
    let track_m = mission.body().track_m;
    let turn = |side: f64| [-side * 0.12, side * 0.12];
    // Seconds, and the speeds of the rims.
    let mut legs = vec![
        (2.5, [0.0; 2]),
        (8.0, turn(1.0)),
        (1.0, [0.0; 2]),
        (8.0, turn(-1.0)),
        (1.0, [0.0; 2]),
        (2.0, [0.15; 2]),
        (1.0, [0.0; 2]),
    ];
    legs.extend((0..8).map(|leg| (1.6, turn(if leg % 2 == 0 { 1.0 } else { -1.0 }))));
    let table = mission.sensor_table();
    let (first, step) = (-TAU / 2.0, TAU / BEAMS as f64);
    let header = ScanHeader::of(0, &table[0]);
    let (mut trace, mut pose, mut rolled, mut poses) =
        (Trace::default(), Pose2::default(), [0.0; 2], Vec::new());
    let mut at = 0.0;
    for (seconds, told) in legs {
        trace.told.push((at, told));
        for _ in 0..(seconds * RATE_HZ) as usize {
            at += 1.0 / RATE_HZ;
            let rims = [0, 1].map(|wheel| told[wheel] * [robot.left_motor, 1.0][wheel] / RATE_HZ);
            let [left, right] = rims.map(|rim| rim * robot.wheel);
            let went = if robot.motors_swapped { [right, left] } else { [left, right] };
            pose = pose.along_arc(
                (went[0] + went[1]) / 2.0,
                (went[1] - went[0]) / (track_m * robot.track),
            );
            let counted = robot
                .encoders
                .map(|(wheel, sign)| sign * rims[wheel] * [robot.left_motor, 1.0][wheel]);
            rolled = [0, 1].map(|wheel| rolled[wheel] + counted[wheel]);
            trace.rolled.push((at, rolled));
            trace.told.push((at, told));
            poses.push(pose);
            let seen = poses[poses.len().saturating_sub(1 + (robot.late_s * RATE_HZ) as usize)];
            if table[0].kind == SensorKind::Cone {
                let reading = |row: usize| {
                    let along = DVec2::from_angle(pose.heading + table[row].mount.bearing_rad);
                    let range = range(pose.position, along) - 0.1;
                    range_reading(row, &table[row], Some(range))
                };
                trace.ranges.push((at, (0..table.len()).map(reading).collect()));
                continue;
            }
            let laser = seen.position + seen.axis() * robot.laser_m;
            let beam = |beam: usize| {
                let beam = if robot.mirrored { (BEAMS - beam) % BEAMS } else { beam };
                let along = seen.heading + robot.yaw_rad + first + step * beam as f64;
                range(laser, DVec2::from_angle(along)) as f32
            };
            trace.scans.push((at, header, (0..BEAMS).map(beam).collect()));
        }
    }
    trace
}

fn wrong_of(mission: &Mission, trace: &Trace) -> Vec<String> {
    let (found, _) = findings(mission, trace, false);
    found.into_iter().filter(|it| it.verdict == Verdict::Wrong).map(|it| it.part).collect()
}

fn wrong(robot: Robot) -> Vec<String> {
    wrong_of(&mission(), &trace(&mission(), robot))
}

fn key(robot: Robot, name: &str) -> f64 {
    let (found, _) = findings(&mission(), &trace(&mission(), robot), false);
    let keys = found.iter().flat_map(|it| &it.keys);
    keys.filter(|it| it.0 == name).map(|it| it.1.parse().unwrap()).next().unwrap()
}

#[test]
fn nothing_is_wrong_with_a_robot_that_is_as_stated() {
    assert_eq!(wrong(RIGHT), Vec::<String>::new());
}

#[test]
fn a_laser_that_is_turned_mirrored_or_late_is_named_with_the_keys_that_mend_it() {
    let turned = Robot { yaw_rad: 0.3, ..RIGHT };
    assert_eq!(wrong(turned), ["laser"]);
    assert!((key(turned, "robot.sensor.laser.turned_deg") - 0.3_f64.to_degrees()).abs() < 1.5);
    assert_eq!(key(Robot { mirrored: true, ..RIGHT }, "robot.sensor.laser.roll_deg"), 180.0);
    assert_eq!(wrong(Robot { late_s: 0.2, ..RIGHT }), ["laser"]);
}

#[test]
fn the_sizes_of_track_and_wheels_are_found() {
    let body = mission().body();
    let track = key(Robot { track: 1.15, ..RIGHT }, "robot.track_m") / body.track_m;
    assert!((track - 1.15).abs() < 0.03, "{track}");
    let wheel = key(Robot { wheel: 0.9, ..RIGHT }, "robot.wheel_radius_m") / body.wheel_radius_m;
    assert!((wheel - 0.9).abs() < 0.03, "{wheel}");
}

#[test]
fn encoders_that_are_swapped_reversed_or_dead_and_a_reversed_motor_are_told_apart() {
    let encoders = |encoders| wrong(Robot { encoders, ..RIGHT });
    for wrong in [[(1, 1.0), (0, 1.0)], [(0, -1.0), (1, 1.0)], [(0, 0.0), (1, 1.0)]] {
        assert!(encoders(wrong).contains(&"wheels".to_owned()), "{wrong:?}");
    }
    // The encoder sits on the motor: what it counts is as told.
    assert_eq!(wrong(Robot { left_motor: -1.0, ..RIGHT }), ["motors"]);
}

#[test]
fn sonars_alone_tell_counts_per_turn_from_motors_that_are_swapped() {
    let mission = with_sonars();
    let wrong = |robot| wrong_of(&mission, &trace(&mission, robot));
    assert_eq!(wrong(RIGHT), Vec::<String>::new());
    assert_eq!(wrong(Robot { motors_swapped: true, ..RIGHT }), ["motors"]);
    for wheel in [1.0 / 1.5, 1.5] {
        assert_eq!(wrong(Robot { wheel, ..RIGHT }), ["wheel size"], "{wheel}");
    }
}

#[test]
fn the_keys_of_a_laser_behind_the_centre_do_not_turn_it() {
    let behind = Robot { laser_m: -0.1, ..RIGHT };
    assert_eq!(wrong(behind), ["laser"]);
    assert!((key(behind, "robot.sensor.laser.forward_m") + 0.1).abs() < 0.02);
    let looks =
        ["bearing_deg", "turned_deg"].map(|it| key(behind, &format!("robot.sensor.laser.{it}")));
    assert!((looks[0] + looks[1]).abs() < 1.5, "{looks:?}");
}

#[test]
fn a_recording_that_begins_in_a_turn_is_no_finding() {
    let mut late = trace(&mission(), RIGHT);
    late.rolled.retain(|it| it.0 > 4.0);
    late.told.retain(|it| it.0 > 5.0);
    late.scans.retain(|it| it.0 > 4.0);
    let (found, placed) = findings(&mission(), &late, false);
    assert!(placed.is_none() && found.iter().all(|it| it.verdict != Verdict::Wrong), "{found:?}");
    assert!(found.iter().any(|it| it.part == "recording"), "{found:?}");
}
