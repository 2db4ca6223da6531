use std::{
    f64::consts::{FRAC_PI_2, TAU},
    fmt::Debug,
    str::FromStr,
};

use super::*;
use common::{
    driver::range_reading,
    kinematics::Pose2,
    mission::{Channel, Protocol, SensorKind},
    samples::ScanHeader,
};

const BEAMS: usize = 180;
const RATE_HZ: f64 = 10.0;

type Wires = [(usize, f64); 2];

#[derive(Clone, Copy, Debug)]
struct Robot {
    yaw_rad: f64,
    mirrored: bool,
    late_s: f64,
    track: f64,
    wheel: f64,
    ratio: f64,
    encoders: Wires,
    /// Command that each motor follows, and its direction.
    motors: Wires,
    laser_m: f64,
}

const AS_STATED: Wires = [(0, 1.0), (1, 1.0)];
const RIGHT: Robot = Robot {
    yaw_rad: 0.0,
    mirrored: false,
    late_s: 0.0,
    track: 1.0,
    wheel: 1.0,
    ratio: 1.0,
    encoders: AS_STATED,
    motors: AS_STATED,
    laser_m: 0.05,
};

fn through(wires: Wires, values: [f64; 2]) -> [f64; 2] {
    wires.map(|(from, sign)| sign * values[from])
}

fn parsed(text: &str) -> Mission {
    Mission::parse(text, "m.toml").unwrap()
}

fn mission() -> Mission {
    parsed(
        "target = [1, 0]\n[robot]\nmodel = 'kobuki'\nrate_hz = 10.0\n[[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nmodel = 'rplidar-a1'\nforward_m = 0.05\nbearing_deg = 0.0\nbeams = 180",
    )
}

fn with_sonars() -> Mission {
    let mut text = "target = [1, 0]\n[robot]\nmodel = 'x80'\nrate_hz = 10.0\n".to_owned();
    for (channel, bearing) in [(0, 0), (1, 40), (2, -40)] {
        text += &format!(
            "[[robot.sensor]]\nname = 'sonar{channel}'\nkind = 'cone'\nchannel = {channel}\nforward_m = 0.1\nbearing_deg = {bearing}\n"
        );
    }
    parsed(&text)
}

/// Range from `at` along `along` to the nearest wall: 1.4 m ahead, 1.9 m behind, 1.6 m left, 1.2 m
/// right.
fn range(at: DVec2, along: DVec2) -> f64 {
    let end = |ahead: f64, behind: f64, at: f64, along: f64| {
        let wall = if along > 0.0 { ahead } else { -behind };
        if along.abs() > 1e-9 { (wall - at) / along } else { f64::INFINITY }
    };
    end(1.4, 1.9, at.x, along.x).min(end(1.6, 1.2, at.y, along.y))
}

fn trace(mission: &Mission, robot: Robot) -> Trace {
    let track_m = mission.body().track_m;
    let turn = |side: f64| [-side * 0.12, side * 0.12];
    let rest = (1.0, [0.0; 2]);
    let mut legs = vec![(2.5, [0.0; 2]), (8.0, turn(1.0)), rest, (8.0, turn(-1.0)), rest];
    legs.extend([(2.0, [0.15; 2]), rest]);
    legs.extend([(1.6, turn(1.0)), (1.6, turn(-1.0))].repeat(4));
    let table = mission.sensor_table();
    let (first, step) = (-TAU / 2.0, TAU / BEAMS as f64);
    let header = ScanHeader::of(0, &table[0]);
    let (mut trace, mut pose, mut rolled, mut poses) =
        (Trace::default(), Pose2::default(), [0.0; 2], Vec::new());
    let (mut at, mut product, mut square) = (0.0, 0.0, 0.0);
    for (seconds, told) in legs {
        trace.told.push((at, told));
        for _ in 0..(seconds * RATE_HZ) as usize {
            at += 1.0 / RATE_HZ;
            let rims = through(robot.motors, told.map(|told| told / RATE_HZ));
            let [left, right] = rims.map(|rim| rim * robot.wheel * 2.0 / (1.0 + robot.ratio));
            let right = right * robot.ratio;
            let turn = (right - left) / (track_m * robot.track);
            pose = pose.along_arc((left + right) / 2.0, turn);
            let counted = through(robot.encoders, rims);
            rolled = [0, 1].map(|wheel| rolled[wheel] + counted[wheel]);
            let turn_by_counts = (counted[1] - counted[0]) / track_m;
            product += turn_by_counts * turn;
            square += turn_by_counts.powi(2);
            trace.rolled.push((at, rolled));
            trace.told.push((at, told));
            trace.gyro.push((at, turn));
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
    trace.sent = trace.told.clone();
    // The driver drops a gyro that contradicts the wheels' counts.
    if !(0.5..2.0).contains(&(product / square)) {
        trace.gyro.clear();
    }
    trace
}

/// Returns the findings about `robot`, without its gyro unless asked.
fn found(mission: &Mission, robot: Robot, has_gyro: bool) -> Vec<Finding> {
    let mut trace = trace(mission, robot);
    if !has_gyro {
        trace.gyro.clear();
    }
    findings(mission, &trace, false).0
}

fn wrong(found: &[Finding]) -> Vec<&str> {
    found.iter().filter(|it| it.verdict == Verdict::Wrong).map(|it| it.part.as_str()).collect()
}

fn key<T: FromStr<Err: Debug>>(found: &[Finding], name: &str) -> Option<T> {
    let mut keys = found.iter().flat_map(|it| &it.keys);
    keys.find(|it| it.0 == name).map(|it| it.1.parse().unwrap())
}

#[test]
fn what_is_wrong_is_named_with_the_keys_that_mend_it() {
    let (mission, body) = (mission(), mission().body());
    let [turned, forward] =
        ["turned_deg", "forward_m"].map(|key| format!("robot.sensor.laser.{key}"));
    let roll = "robot.sensor.laser.roll_deg";
    let ratio = "robot.odometry.diameter_ratio";
    for (robot, parts, keys) in [
        (RIGHT, &[][..], &[][..]),
        (Robot { yaw_rad: 0.3, ..RIGHT }, &["laser"], &[(&*turned, 17.2, 1.5)]),
        (Robot { mirrored: true, ..RIGHT }, &["laser"], &[(roll, 180.0, 0.1)]),
        (Robot { late_s: 0.2, ..RIGHT }, &["laser"], &[]),
        (
            Robot { track: 1.15, ..RIGHT },
            &["track"],
            &[("robot.track_m", 1.15 * body.track_m, 0.007)],
        ),
        (
            Robot { wheel: 0.9, ..RIGHT },
            &["wheel size"],
            &[("robot.wheel_radius_m", 0.9 * body.wheel_radius_m, 0.001)],
        ),
        // A laser upside down sees the larger wheel on the other side.
        (
            Robot { ratio: 1.06, mirrored: true, ..RIGHT },
            &["laser", "wheel ratio"],
            &[(ratio, 1.06, 0.02)],
        ),
        (Robot { laser_m: -0.1, ..RIGHT }, &["laser"], &[(&*forward, -0.1, 0.02)]),
        (Robot { encoders: [(0, 0.0), (1, 1.0)], ..RIGHT }, &["wheels", "gyro"], &[]),
    ] {
        let found = found(&mission, robot, true);
        assert_eq!(wrong(&found), parts, "{robot:?}: {found:?}");
        for &(name, value, within) in keys {
            let off = key::<f64>(&found, name).unwrap() - value;
            assert!(off.abs() <= within, "{robot:?}, {name}: {off}");
        }
        // The keys of a laser behind the centre do not turn it.
        if robot.laser_m < 0.0 {
            let bearing: f64 = key(&found, "robot.sensor.laser.bearing_deg").unwrap();
            assert!((bearing + key::<f64>(&found, &turned).unwrap()).abs() < 1.5, "{bearing}");
        }
    }
}

#[test]
fn without_a_gyro_a_laser_upside_down_may_as_well_be_swapped_motors_and_no_key_is_given() {
    for (ratio, part) in [(1.0, "laser"), (1.06, "wheel ratio")] {
        let found = found(&mission(), Robot { mirrored: true, ratio, ..RIGHT }, false);
        assert!(wrong(&found).contains(&part), "{found:?}");
        let named = found.iter().filter(|it| ratio == 1.0 || it.part == part);
        assert!(named.clone().all(|it| it.keys.is_empty()), "{found:?}");
    }
}

#[test]
fn the_keys_of_a_robot_of_ros_2_mend_what_its_odometry_says() {
    let mut mission = mission();
    mission.robot.protocol = Some(Protocol::Ros2);
    let mut trace = trace(&mission, Robot { wheel: 0.9, track: 1.15, ..RIGHT });
    let (found, _) = findings(&mission, &trace, false);
    let odometry = &mut mission.robot.odometry;
    odometry.distance_scale = key(&found, "robot.odometry.distance_scale").unwrap();
    odometry.track_scale = key(&found, "robot.odometry.track_scale").unwrap();
    for (_, rolled) in &mut trace.rolled {
        *rolled = rolled.map(|it| it * odometry.distance_scale);
    }
    assert_eq!(wrong(&findings(&mission, &trace, false).0), [""; 0]);
}

fn all_wires() -> impl Iterator<Item = Wires> {
    (0..8).map(|bits: usize| {
        let sign = |bit: usize| if bits & bit == 0 { 1.0 } else { -1.0 };
        let first = usize::from(bits & 4 != 0);
        [(first, sign(1)), (1 - first, sign(2))]
    })
}

/// Returns the faulty parts of `robot`, whose motors are determined if `is_told`, and the keys that
/// repair an X80.
fn expected(robot: Robot, mission: &Mission, is_told: bool) -> (Vec<&'static str>, Vec<Channel>) {
    let probe = [1.0, 2.0];
    let as_told = through(robot.encoders, through(robot.motors, probe)) == probe;
    let encoders_wrong = !as_told && (!is_told || robot.encoders != AS_STATED);
    let motors_wrong = robot.motors != AS_STATED;
    let mut parts = Vec::new();
    parts.extend(encoders_wrong.then_some("wheels"));
    parts.extend(motors_wrong.then_some("motors"));
    let stated = [mission.robot.left, mission.robot.right];
    let mended = robot.motors.map(|(from, sign)| {
        let Channel { channel, reversed } = stated[from];
        Channel { channel, reversed: reversed != (sign < 0.0) }
    });
    (parts, if as_told && is_told { mended.to_vec() } else { stated.to_vec() })
}

fn with_keys(mission: &Mission, found: &[Finding]) -> Vec<Channel> {
    let of = |side: &str, stated: Channel| Channel {
        channel: key(found, &format!("robot.{side}.channel")).unwrap_or(stated.channel),
        reversed: key(found, &format!("robot.{side}.reversed")).unwrap_or(stated.reversed),
    };
    vec![of("left", mission.robot.left), of("right", mission.robot.right)]
}

/// Returns whether a single wheel turns backwards, so that turning drives the body.
fn exchanges(motors: Wires) -> bool {
    motors[0].1 != motors[1].1
}

#[test]
fn sonars_tell_all_swapped_and_reversed_motors_and_encoders_right_or_as_undecided() {
    let mission = with_sonars();
    for (motors, encoders) in all_wires().flat_map(|it| all_wires().map(move |other| (it, other))) {
        let robot = Robot { motors, encoders, ..RIGHT };
        let found = found(&mission, robot, false);
        let (parts, channels) = expected(robot, &mission, !exchanges(motors));
        assert_eq!(wrong(&found), parts, "{motors:?} {encoders:?}: {found:?}");
        assert_eq!(with_keys(&mission, &found), channels, "{motors:?} {encoders:?}: {found:?}");
    }
}

#[test]
fn a_laser_tells_all_swapped_and_reversed_motors_and_encoders_right_or_as_undecided() {
    let mission = mission();
    let tells = |motors: Wires| {
        for encoders in [motors.map(|(_, sign)| sign), [1.0, 1.0], [-1.0, 1.0]] {
            let encoders = [0, 1].map(|it| (motors[it].0, encoders[it]));
            let robot = Robot { motors, encoders, ..RIGHT };
            let trace = trace(&mission, robot);
            let (found, _) = findings(&mission, &trace, false);
            let [(left, sign), _] = motors;
            let drives_back_only = left == 1 && sign < 0.0;
            let is_told = exchanges(motors)
                || motors == AS_STATED
                || !trace.gyro.is_empty() && !drives_back_only;
            let (mut parts, _) = expected(robot, &mission, is_told);
            if !is_told {
                *parts.last_mut().unwrap() = "laser";
            }
            assert_eq!(wrong(&found), parts, "{robot:?}: {found:?}");
            assert!(found.iter().all(|it| it.keys.is_empty()), "{robot:?}: {found:?}");
        }
    };
    std::thread::scope(|threads| {
        for motors in all_wires() {
            threads.spawn(move || tells(motors));
        }
    });
}

#[test]
fn sonars_alone_tell_counts_per_turn_from_motors_that_are_swapped() {
    for wheel in [1.0 / 1.5, 1.5] {
        let found = found(&with_sonars(), Robot { wheel, ..RIGHT }, false);
        assert_eq!(wrong(&found), ["wheel size"], "{wheel}");
    }
}

#[test]
fn a_recording_that_begins_in_a_turn_is_no_finding() {
    let mut late = trace(&mission(), RIGHT);
    late.rolled.retain(|it| it.0 > 4.0);
    late.told.retain(|it| it.0 > 5.0);
    late.scans.retain(|it| it.0 > 4.0);
    let (found, seen) = findings(&mission(), &late, false);
    assert!(seen.is_empty() && wrong(&found).is_empty(), "{found:?}");
    assert!(found.iter().any(|it| it.part == "recording"), "{found:?}");
}

#[test]
fn echoes_are_drawn_where_they_ended_when_the_robot_has_turned_and_driven() {
    let mission = parsed("target = [3, 0]\nsensors = 'front'");
    let motion = vec![(0.0, [0.0, 0.0]), (1.0, [FRAC_PI_2, 0.0]), (2.0, [FRAC_PI_2, 0.5])];
    let row = mission.front_row();
    let sensor = &mission.sensor_table()[row];
    let echo = range_reading(row, sensor, Some(1.0));
    let ranges = vec![(0.0, vec![echo]), (1.5, Vec::new()), (2.0, vec![echo])];
    let seen = rangers::echoes(&mission, &Trace { ranges, ..Trace::default() }, &motion);
    let ahead_m = 1.0 + sensor.mount.forward_m;
    for (seen, ended) in seen.iter().zip([DVec2::new(ahead_m, 0.0), DVec2::new(0.0, 0.5 + ahead_m)])
    {
        assert!(seen.distance(ended) < 1e-9, "{seen}");
    }
    assert_eq!(seen.len(), 2);
}
