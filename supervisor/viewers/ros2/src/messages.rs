//! The messages that the bridge writes. Their definitions are those of ROS 2 Kilted; earlier releases read the beginning of a
//! message to which later ones appended. Lengths are metres, angles radians.

use std::f64::consts::TAU;

pub use ros2::messages::{Header, battery, odometry, scan};
use ros2::{
    cdr::Writer,
    messages::{COVARIANCE, begin},
    parts::Pose,
};

/// A `tf2_msgs/TFMessage` of frames and the frames in them.
pub fn transforms(ns: u64, transforms: &[(&str, &str, Pose)]) -> Vec<u8> {
    let mut writer = Writer::default();
    let transform = |writer: &mut Writer, &(parent, child, pose): &(&str, &str, Pose)| {
        writer.header(ns, parent).text(child).pose(pose);
    };
    writer.list(transforms, transform).take()
}

/// A `geometry_msgs/PoseWithCovarianceStamped`.
pub fn pose(header: Header<'_>, pose: Pose, covariance: &[f64; COVARIANCE]) -> Vec<u8> {
    begin(header).pose(pose).f64s(covariance).take()
}

/// A `nav_msgs/OccupancyGrid` of square cells; `corner` is the corner of the first cell, and its rows go along x.
pub fn map(
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
pub fn map_update(
    header: Header<'_>,
    [col, row]: [u32; 2],
    [width, height]: [u32; 2],
    cells: &[u8],
) -> Vec<u8> {
    let mut writer = begin(header);
    writer.u32(col).u32(row).u32(width).u32(height).length(cells.len()).raw(cells).take()
}

/// A `nav_msgs/Path`.
pub fn path(header: Header<'_>, poses: &[Pose]) -> Vec<u8> {
    let mut writer = Writer::default();
    write_path(&mut writer, header, poses);
    writer.take()
}

pub fn write_path(writer: &mut Writer, Header(ns, frame): Header<'_>, poses: &[Pose]) {
    let stamped = |writer: &mut Writer, pose: &Pose| pose_stamped(writer, Header(ns, frame), *pose);
    writer.header(ns, frame).list(poses, stamped);
}

/// A `geometry_msgs/PoseStamped` as a part of a message.
pub fn pose_stamped(writer: &mut Writer, Header(ns, frame): Header<'_>, pose: Pose) {
    writer.header(ns, frame).pose(pose);
}

#[derive(Clone, Copy, Default)]
pub enum Shape {
    #[default]
    Cylinder = 3,
    Lines = 5,
}

/// A `visualization_msgs/Marker`.
#[derive(Clone, Default)]
pub struct Marker {
    pub namespace: &'static str,
    pub id: i32,
    pub shape: Shape,
    pub pose: Pose,
    /// The size along x, y and z; lines have their width in the first.
    pub scale: [f64; 3],
    /// The colour: red, green, blue, alpha.
    pub color: [f32; 4],
    pub points: Vec<[f64; 2]>,
}

/// The action that removes all markers that were sent before.
const DELETE_ALL: i32 = 3;

/// A `visualization_msgs/MarkerArray` that replaces the one before.
pub fn markers(header: Header<'_>, markers: &[Marker]) -> Vec<u8> {
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

/// A range as REP 117 has it: nearer than `least` and farther than `most` are infinite, and no measurement is not a number.
pub fn within([least, most]: [f64; 2], range: f64) -> f64 {
    if range < least {
        f64::NEG_INFINITY
    } else if range > most {
        f64::INFINITY
    } else {
        range
    }
}

/// A `sensor_msgs/Range` of a sonar, or of an infrared ranger.
pub fn range(
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

/// A `rcl_interfaces/Log` of a part of the robot, with its severity.
pub fn log(ns: u64, severity: u8, name: &str, text: &str) -> Vec<u8> {
    Writer::default().time(ns).u8(severity).text(name).text(text).text("").text("").u32(0).take()
}

/// The severity of a `diagnostic_msgs/DiagnosticStatus`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Level {
    #[default]
    Ok = 0,
    Warn = 1,
    Error = 2,
}

/// A `diagnostic_msgs/DiagnosticStatus`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Status {
    pub level: Level,
    pub name: String,
    pub message: String,
    pub values: Vec<(&'static str, String)>,
}

/// A `diagnostic_msgs/DiagnosticArray` of this robot.
pub fn diagnostics(header: Header<'_>, robot: &str, statuses: &[Status]) -> Vec<u8> {
    let status = |writer: &mut Writer, status: &Status| {
        writer.u8(status.level as u8).text(&status.name).text(&status.message).text(robot);
        writer.list(&status.values, |writer, (key, value)| {
            writer.text(key).text(value);
        });
    };
    begin(header).list(statuses, status).take()
}
