//! Messages that a robot publishes. Lengths are metres, angles radians, times seconds unless a name says otherwise.

use crate::{cdr::Writer, parts::Pose};

/// The count of numbers in the covariance of a pose or a twist.
pub const COVARIANCE: usize = 36;

/// The time of a message, nanoseconds since 1970, and its frame.
#[derive(Clone, Copy, Debug)]
pub struct Header<'a>(pub u64, pub &'a str);

pub fn begin(Header(ns, frame): Header<'_>) -> Writer {
    let mut writer = Writer::default();
    writer.header(ns, frame);
    writer
}

/// A `nav_msgs/Odometry`, with the covariances of the pose and of the speeds.
pub fn odometry(
    header: Header<'_>,
    child: &str,
    (pose, of_pose): (Pose, &[f64; COVARIANCE]),
    ([v, omega], of_speeds): ([f64; 2], &[f64; COVARIANCE]),
) -> Vec<u8> {
    let speeds = [v, 0.0, 0.0, 0.0, 0.0, omega];
    begin(header).text(child).pose(pose).f64s(of_pose).f64s(&speeds).f64s(of_speeds).take()
}

/// A `sensor_msgs/LaserScan`; `times_s` are those from beam to beam and from scan to scan.
pub fn scan(
    header: Header<'_>,
    [first, step]: [f64; 2],
    [least, most]: [f64; 2],
    times_s: [f64; 2],
    ranges: &[f32],
) -> Vec<u8> {
    let last = first + step * ranges.len().saturating_sub(1) as f64;
    let mut writer = begin(header);
    for number in [first, last, step, times_s[0], times_s[1], least, most] {
        writer.f32(number as f32);
    }
    let range = |writer: &mut Writer, range: &f32| {
        writer.f32(*range);
    };
    // There are no intensities.
    writer.list(ranges, range).length(0).take()
}

/// A `sensor_msgs/BatteryState` that states the voltage only.
pub fn battery(header: Header<'_>, volts: f64) -> Vec<u8> {
    let mut writer = begin(header);
    writer.f32(volts as f32);
    for _temperature_current_charge_capacity_design_percentage in 0..6 {
        writer.f32(f32::NAN);
    }
    // Status, health and technology are unknown; the battery is present; there are no cells, place or number.
    writer.u8(0).u8(0).u8(0).u8(1).length(0).length(0).text("").text("").take()
}
