//! Messages that a robot publishes, in metres, radians and seconds unless a name says otherwise.

use crate::{
    cdr::Cdr as _,
    msg::{
        BatteryState, Header, LaserScan, Odometry, PoseWithCovariance, Twist, TwistWithCovariance,
        Vector3,
    },
    parts::Pose,
};

/// Numbers in the covariance of a pose or a twist.
pub const COVARIANCE: usize = 36;

pub fn twist([v, omega]: [f64; 2]) -> Twist {
    Twist {
        linear: Vector3 { x: v, ..Vector3::default() },
        angular: Vector3 { z: omega, ..Vector3::default() },
    }
}

pub fn odometry(
    header: Header,
    child: &str,
    (pose, of_pose): (Pose, [f64; COVARIANCE]),
    (speeds, of_speeds): ([f64; 2], [f64; COVARIANCE]),
) -> Vec<u8> {
    let pose = PoseWithCovariance { pose: pose.into(), covariance: of_pose };
    let twist = TwistWithCovariance { twist: twist(speeds), covariance: of_speeds };
    Odometry { header, child_frame_id: child.to_owned(), pose, twist }.encode()
}

/// Encodes a scan; `times_s` are the times between beams and between scans.
pub fn scan(
    header: Header,
    [first, step]: [f64; 2],
    limits: [f64; 2],
    times_s: [f64; 2],
    ranges: Vec<f32>,
) -> Vec<u8> {
    let last = first + step * ranges.len().saturating_sub(1) as f64;
    let [angle_min, angle_max, angle_increment] = [first, last, step].map(|angle| angle as f32);
    let [time_increment, scan_time] = times_s.map(|time| time as f32);
    let [range_min, range_max] = limits.map(|limit| limit as f32);
    LaserScan {
        header,
        angle_min,
        angle_max,
        angle_increment,
        time_increment,
        scan_time,
        range_min,
        range_max,
        ranges,
        ..LaserScan::default()
    }
    .encode()
}

pub fn battery(header: Header, volts: f64) -> Vec<u8> {
    BatteryState {
        header,
        voltage: volts as f32,
        temperature: f32::NAN,
        current: f32::NAN,
        charge: f32::NAN,
        capacity: f32::NAN,
        design_capacity: f32::NAN,
        percentage: f32::NAN,
        present: true,
        ..BatteryState::default()
    }
    .encode()
}
