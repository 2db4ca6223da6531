//! Messages that show a robot. Lengths are metres, angles radians.
//!
//! Earlier ROS releases read a prefix of messages that later releases extended.

use glam::DVec2;
use ros2::{
    cdr::Cdr as _,
    msg::{
        ColorRGBA, Header, Marker, MarkerArray, Path, Point, TFMessage, TransformStamped, Vector3,
    },
    parts::Pose,
};

pub fn transforms(ns: u64, transforms: &[(&str, &str, Pose)]) -> Vec<u8> {
    let transform = |&(parent, child, pose): &(&str, &str, Pose)| TransformStamped {
        header: Header::at(ns, parent),
        child_frame_id: child.to_owned(),
        transform: pose.into(),
    };
    TFMessage { transforms: transforms.iter().map(transform).collect() }.encode()
}

pub fn path(header: Header, poses: &[Pose]) -> Path {
    Path { poses: poses.iter().map(|pose| header.with(*pose)).collect(), header }
}

pub fn disc((ns, id): (&str, i32), pose: Pose, across: f64, color: [f32; 4]) -> Marker {
    let scale = Vector3 { x: across, y: across, z: 0.01 };
    Marker { r#type: Marker::CYLINDER, pose: pose.into(), scale, ..marker((ns, id), color) }
}

/// Draws a line from each even-numbered point to the next.
pub fn lines((ns, id): (&str, i32), points: &[DVec2], width: f64, color: [f32; 4]) -> Marker {
    let points = points.iter().map(|at| Point { x: at.x, y: at.y, z: 0.0 }).collect();
    let scale = Vector3 { x: width, ..Vector3::default() };
    Marker { r#type: Marker::LINE_LIST, points, scale, ..marker((ns, id), color) }
}

fn marker((ns, id): (&str, i32), [r, g, b, a]: [f32; 4]) -> Marker {
    Marker { ns: ns.to_owned(), id, color: ColorRGBA { r, g, b, a }, ..Marker::default() }
}

/// Encodes markers that replace all earlier ones.
pub fn markers(header: &Header, mut markers: Vec<Marker>) -> Vec<u8> {
    let (action, r#type) = (Marker::DELETEALL, Marker::CYLINDER);
    markers.insert(0, Marker { action, r#type, ..Marker::default() });
    markers.iter_mut().for_each(|marker| marker.header = header.clone());
    MarkerArray { markers }.encode()
}

/// Limits a range by REP 117: below `least` is -infinity, above `most` +infinity. NaN means no
/// measurement.
pub fn within([least, most]: [f64; 2], range: f64) -> f64 {
    if range < least {
        f64::NEG_INFINITY
    } else if range > most {
        f64::INFINITY
    } else {
        range
    }
}
