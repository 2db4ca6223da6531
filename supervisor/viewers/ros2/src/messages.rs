//! The messages that the bridge writes. Their definitions are those of ROS 2 Kilted; earlier releases read the beginning of a
//! message to which later ones appended. Lengths are metres, angles radians.

use std::f64::consts::TAU;

use ros2::{cdr::Writer, parts::Pose};

/// The count of numbers in the covariance of a pose or a twist.
const COVARIANCE: usize = 36;

/// The time of a message, nanoseconds since 1970, and its frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Header<'a>(pub u64, pub &'a str);

/// The beginning of a message with this header.
fn begin(Header(ns, frame): Header<'_>) -> Writer {
    let mut writer = Writer::default();
    writer.header(ns, frame);
    writer
}

/// A `tf2_msgs/TFMessage` of frames and the frames in them.
pub(crate) fn transforms(ns: u64, transforms: &[(&str, &str, Pose)]) -> Vec<u8> {
    let mut writer = Writer::default();
    let transform = |writer: &mut Writer, &(parent, child, pose): &(&str, &str, Pose)| {
        writer.header(ns, parent).text(child).pose(pose);
    };
    writer.list(transforms, transform).take()
}

/// A `geometry_msgs/PoseWithCovarianceStamped`.
pub(crate) fn pose(header: Header<'_>, pose: Pose, covariance: &[f64; COVARIANCE]) -> Vec<u8> {
    begin(header).pose(pose).f64s(covariance).take()
}

/// A `nav_msgs/Odometry` that states no covariance.
pub(crate) fn odometry(
    header: Header<'_>,
    child: &str,
    pose: Pose,
    [v, omega]: [f64; 2],
) -> Vec<u8> {
    let unknown = [0.0; COVARIANCE];
    let twist = [v, 0.0, 0.0, 0.0, 0.0, omega];
    begin(header).text(child).pose(pose).f64s(&unknown).f64s(&twist).f64s(&unknown).take()
}

/// A `nav_msgs/OccupancyGrid` of square cells; `corner` is the corner of the first cell, and its rows go along x.
pub(crate) fn map(
    header: Header<'_>,
    resolution: f64,
    [width, height]: [u32; 2],
    corner: [f64; 2],
    cells: &[u8],
) -> Vec<u8> {
    let Header(ns, _) = header;
    let mut writer = begin(header);
    writer.time(ns).f32(resolution as f32).u32(width).u32(height).pose([corner[0], corner[1], 0.0]);
    writer.length(cells.len()).raw(cells).take()
}

/// A `map_msgs/OccupancyGridUpdate` of a window whose first cell is this one.
pub(crate) fn map_update(
    header: Header<'_>,
    [col, row]: [u32; 2],
    [width, height]: [u32; 2],
    cells: &[u8],
) -> Vec<u8> {
    let mut writer = begin(header);
    writer.u32(col).u32(row).u32(width).u32(height).length(cells.len()).raw(cells).take()
}

/// A `nav_msgs/Path`.
pub(crate) fn path(header: Header<'_>, poses: &[Pose]) -> Vec<u8> {
    let mut writer = Writer::default();
    write_path(&mut writer, header, poses);
    writer.take()
}

/// A `nav_msgs/Path` as a part of a message.
pub(crate) fn write_path(writer: &mut Writer, Header(ns, frame): Header<'_>, poses: &[Pose]) {
    let stamped = |writer: &mut Writer, pose: &Pose| pose_stamped(writer, Header(ns, frame), *pose);
    writer.header(ns, frame).list(poses, stamped);
}

/// A `geometry_msgs/PoseStamped` as a part of a message.
pub(crate) fn pose_stamped(writer: &mut Writer, Header(ns, frame): Header<'_>, pose: Pose) {
    writer.header(ns, frame).pose(pose);
}

/// The shapes of markers that are used.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) enum Shape {
    #[default]
    Cylinder = 3,
    /// Lines, each between two points.
    Lines = 5,
}

/// A `visualization_msgs/Marker`.
#[derive(Clone, Debug, Default)]
pub(crate) struct Marker {
    pub(crate) namespace: &'static str,
    pub(crate) id: i32,
    pub(crate) shape: Shape,
    pub(crate) pose: Pose,
    /// The size along x, y and z; lines have their width in the first.
    pub(crate) scale: [f64; 3],
    /// The colour: red, green, blue, alpha.
    pub(crate) color: [f32; 4],
    pub(crate) points: Vec<[f64; 2]>,
}

/// The action that removes all markers that were sent before.
const DELETE_ALL: i32 = 3;

/// A `visualization_msgs/MarkerArray` that replaces the one before.
pub(crate) fn markers(header: Header<'_>, markers: &[Marker]) -> Vec<u8> {
    let mut writer = Writer::default();
    writer.length(markers.len() + 1);
    marker(&mut writer, header, &Marker::default(), DELETE_ALL);
    for each in markers {
        marker(&mut writer, header, each, 0);
    }
    writer.take()
}

fn marker(writer: &mut Writer, Header(ns, frame): Header<'_>, marker: &Marker, action: i32) {
    writer.header(ns, frame).text(marker.namespace).i32(marker.id).i32(marker.shape as i32);
    writer.i32(action).pose(marker.pose).f64s(&marker.scale);
    for part in marker.color {
        writer.f32(part);
    }
    // The marker has no end, and stays where it is if its frame moves.
    writer.i32(0).u32(0).u8(0);
    writer.list(&marker.points, |writer, &[x, y]| {
        writer.f64s(&[x, y, 0.0]);
    });
    // There are no colours of points, and no texture with its header, format, bytes and coordinates.
    writer.length(0).text("").header(0, "").text("").length(0).length(0);
    // There is no text and no mesh.
    writer.text("").text("").text("").length(0).u8(0);
}

/// A `sensor_msgs/LaserScan`.
pub(crate) fn scan(
    header: Header<'_>,
    [first, step]: [f64; 2],
    [least, most]: [f64; 2],
    period_s: f64,
    ranges: &[f32],
) -> Vec<u8> {
    let last = first + step * ranges.len().saturating_sub(1) as f64;
    let mut writer = begin(header);
    for number in [first, last, step, 0.0, period_s, least, most] {
        writer.f32(number as f32);
    }
    let range = |writer: &mut Writer, range: &f32| {
        writer.f32(*range);
    };
    // There are no intensities.
    writer.list(ranges, range).length(0).take()
}

/// A `sensor_msgs/Range` of a sonar, or of an infrared ranger.
pub(crate) fn range(
    header: Header<'_>,
    is_sonar: bool,
    field_of_view: f64,
    [least, most]: [f64; 2],
    range: f64,
) -> Vec<u8> {
    let mut writer = begin(header);
    writer.u8(u8::from(!is_sonar));
    // The variance is not known.
    for number in [field_of_view.min(TAU), least, most, range, 0.0] {
        writer.f32(number as f32);
    }
    writer.take()
}

/// A `sensor_msgs/BatteryState` that states the voltage only.
pub(crate) fn battery(header: Header<'_>, volts: f64) -> Vec<u8> {
    let mut writer = begin(header);
    writer.f32(volts as f32);
    for _temperature_current_charge_capacity_design_percentage in 0..6 {
        writer.f32(f32::NAN);
    }
    // Status, health and technology are unknown; the battery is present; there are no cells, place or number.
    writer.u8(0).u8(0).u8(0).u8(1).length(0).length(0).text("").text("").take()
}

/// The severity of a `diagnostic_msgs/DiagnosticStatus`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Level {
    #[default]
    Ok = 0,
    Warn = 1,
    Error = 2,
}

/// A `diagnostic_msgs/DiagnosticStatus`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Status {
    pub(crate) level: Level,
    pub(crate) name: String,
    pub(crate) message: String,
    pub(crate) values: Vec<(&'static str, String)>,
}

/// A `diagnostic_msgs/DiagnosticArray` of this robot.
pub(crate) fn diagnostics(header: Header<'_>, robot: &str, statuses: &[Status]) -> Vec<u8> {
    let status = |writer: &mut Writer, status: &Status| {
        writer.u8(status.level as u8).text(&status.name).text(&status.message).text(robot);
        writer.list(&status.values, |writer, (key, value)| {
            writer.text(key).text(value);
        });
    };
    begin(header).list(statuses, status).take()
}
