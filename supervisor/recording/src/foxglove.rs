//! Messages for viewers, in Foxglove's schemas as JSON (<https://docs.foxglove.dev/docs/sdk/schemas>): the pose, the safety map,
//! the sensors' cones and rays with the trajectory, log lines.

use common::{
    bus::{decode_sample, decode_slice},
    grid::Replica,
    kinematics::Pose2,
    mission::{Mission, Sensor},
    samples::{GridHeader, PoseSample, RangeReading, RangeStatus, RangesHeader},
    topics::{self, AnyTopic as _},
};
use serde_json::{Value, json};

use crate::downsampled::Downsampled;

/// Channels and their schemas.
pub(crate) const CHANNELS: &[(&str, &str)] = &[
    ("foxglove/pose", "foxglove.PoseInFrame"),
    ("foxglove/grid", "foxglove.Grid"),
    ("foxglove/scene", "foxglove.SceneUpdate"),
    ("log", "foxglove.Log"),
    ("recorder", "firsthand.Recorder"),
];

/// The name of the mission's frame, in which all coordinates are.
const FRAME: &str = "mission";
/// Mission time between scenes and between maps, nanoseconds.
const EVERY_NS: u64 = 1_000_000_000;
/// Points of the trajectory that are drawn. From a longer one every second, fourth, ... point is drawn.
const TRAJECTORY: usize = 1000;

/// Viewers know the schemas by their names; their fields are published at the address above.
pub(crate) fn schema(name: &str) -> String {
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": name,
        "type": "object",
    })
    .to_string()
}

pub(crate) struct Drawn {
    mission: Option<Mission>,
    grid: Replica<u8>,
    grid_ns: Option<u64>,
    scene_ns: Option<u64>,
    pose: Pose2,
    trajectory: Downsampled<[f64; 2], TRAJECTORY>,
}

/// A message: channel, mission time, content.
type Drawing = (&'static str, u64, Value);

impl Drawn {
    pub(crate) fn new(mission: Option<Mission>) -> Self {
        Self {
            mission,
            grid: Replica::default(),
            grid_ns: None,
            scene_ns: None,
            pose: Pose2::default(),
            trajectory: Downsampled::default(),
        }
    }

    /// The messages for viewers that follow from a `message` of `topic`. Mission time 0 is `began_ns` since 1970.
    pub(crate) fn take(&mut self, topic: &str, message: &[u8], began_ns: u64) -> Option<Drawing> {
        if topic == topics::POSE.spec().name {
            return Some(self.pose(&decode_sample(message)?, began_ns));
        }
        if topic == topics::RANGES.spec().name {
            let (header, readings) = decode_slice(message)?;
            return self.scene(&header, &readings, began_ns);
        }
        if topic == topics::GRID.spec().name {
            let (header, cells) = decode_slice(message)?;
            return self.grid(&header, &cells, began_ns);
        }
        None
    }

    fn pose(&mut self, sample: &PoseSample, began_ns: u64) -> Drawing {
        self.pose = sample.pose();
        self.trajectory.push([sample.x_m, sample.y_m]);
        let stamp_ns = sample.stamp.stamp_ns;
        let pose = json!({
            "timestamp": time(began_ns + stamp_ns),
            "frame_id": FRAME,
            "pose": pose(sample.x_m, sample.y_m, sample.heading_rad),
        });
        ("foxglove/pose", stamp_ns, pose)
    }

    fn grid(&mut self, header: &GridHeader, cells: &[u8], began_ns: u64) -> Option<Drawing> {
        let _ = self.grid.apply(&header.part, cells);
        let stamp_ns = header.stamp.stamp_ns;
        let frame = self.grid.frame()?;
        if !is_due(&mut self.grid_ns, stamp_ns) {
            return None;
        }
        let side = frame.resolution_m;
        let half = f64::from(frame.cells / 2) * side + side / 2.0;
        let grid = json!({
            "timestamp": time(began_ns + stamp_ns),
            "frame_id": FRAME,
            "pose": pose(frame.centre.x - half, frame.centre.y - half, 0.0),
            "column_count": frame.cells,
            "cell_size": {"x": side, "y": side},
            "row_stride": frame.cells,
            "cell_stride": 1,
            // 1: UINT8, a `CellState`.
            "fields": [{"name": "state", "offset": 0, "type": 1}],
            "data": base64(self.grid.cells()),
        });
        Some(("foxglove/grid", stamp_ns, grid))
    }

    fn scene(
        &mut self,
        header: &RangesHeader,
        readings: &[RangeReading],
        began_ns: u64,
    ) -> Option<Drawing> {
        let stamp_ns = header.stamp.stamp_ns;
        if !is_due(&mut self.scene_ns, stamp_ns) {
            return None;
        }
        let entity = |id: &str, points: Vec<[f64; 2]>, [r, g, b]: [f64; 3]| {
            let points: Vec<_> =
                points.iter().map(|[x, y]| json!({"x": x, "y": y, "z": 0.0})).collect();
            json!({
                "timestamp": time(began_ns + stamp_ns),
                "frame_id": FRAME,
                "id": id,
                "lifetime": {"sec": 0, "nsec": 0},
                "frame_locked": false,
                // 0: LINE_STRIP, a pixel and a half wide.
                "lines": [{
                    "type": 0,
                    "pose": pose(0.0, 0.0, 0.0),
                    "thickness": 1.5,
                    "scale_invariant": true,
                    "points": points,
                    "color": {"r": r, "g": g, "b": b, "a": 1.0},
                }],
            })
        };
        let mut entities =
            vec![entity("trajectory", self.trajectory.items().to_vec(), [0.0, 0.3, 0.8])];
        if let Some(mission) = &self.mission {
            let table = mission.sensor_table();
            for reading in readings {
                let sensor = table.get(usize::from(reading.sensor));
                if let Some(sensor) = sensor.filter(|sensor| sensor.used) {
                    let outline = outline(sensor, self.pose, reading);
                    entities.push(entity(&sensor.name, outline, [0.9, 0.5, 0.0]));
                }
            }
        }
        let scene = json!({"deletions": [], "entities": entities});
        Some(("foxglove/scene", stamp_ns, scene))
    }
}

/// The outline of what a sensor saw: of a cone from the sensor to both ends of the arc, and along it.
fn outline(sensor: &Sensor, robot: Pose2, reading: &RangeReading) -> Vec<[f64; 2]> {
    /// Pieces of the arc.
    const PIECES: i32 = 8;
    let at = sensor.mount.on(robot);
    let reach = match reading.status() {
        RangeStatus::Measured => reading.range_m,
        _ => 0.0,
    };
    let half = sensor.field_of_view_deg.to_radians() / 2.0;
    let arc = (-PIECES / 2..=PIECES / 2).map(|piece| {
        let bearing = at.heading + half * 2.0 * f64::from(piece) / f64::from(PIECES);
        [at.position.x + reach * bearing.cos(), at.position.y + reach * bearing.sin()]
    });
    let sensor = [at.position.x, at.position.y];
    [sensor].into_iter().chain(arc).chain([sensor]).collect()
}

pub(crate) fn log(process: &str, line: &str, now_ns: u64) -> Value {
    // The numbers of foxglove.LogLevel. Lines without a level say why a process ended, so they are errors.
    let level = ["DEBUG", "INFO", "WARN", "ERROR"]
        .iter()
        .position(|level| line.split_whitespace().take(3).any(|word| word == *level));
    json!({
        "timestamp": time(now_ns),
        "level": level.map_or(4, |level| level + 1),
        "message": line,
        "name": process,
        "file": "",
        "line": 0,
    })
}

fn is_due(last: &mut Option<u64>, now: u64) -> bool {
    let due = last.is_none_or(|last| now.saturating_sub(last) >= EVERY_NS || now < last);
    if due {
        *last = Some(now);
    }
    due
}

fn time(ns: u64) -> Value {
    json!({"sec": ns / 1_000_000_000, "nsec": ns % 1_000_000_000})
}

fn pose(x: f64, y: f64, heading: f64) -> Value {
    let (sin, cos) = (heading / 2.0).sin_cos();
    json!({
        "position": {"x": x, "y": y, "z": 0.0},
        "orientation": {"x": 0.0, "y": 0.0, "z": sin, "w": cos},
    })
}

/// Base64, in which JSON carries bytes (RFC 4648).
pub fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let [a, b, c] = [0, 1, 2].map(|index| u32::from(three.get(index).copied().unwrap_or(0)));
        let bits = a << 16 | b << 8 | c;
        for digit in 0..4 {
            let past_the_end = digit > three.len();
            let index = (bits >> (18 - 6 * digit)) as usize & 63;
            text.push(if past_the_end { '=' } else { char::from(ALPHABET[index]) });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_written_as_rfc_4648_has_them() {
        let of = |text: &str| base64(text.as_bytes());
        assert_eq!(of(""), "");
        assert_eq!(of("f"), "Zg==");
        assert_eq!(of("fo"), "Zm8=");
        assert_eq!(of("foo"), "Zm9v");
        assert_eq!(of("foobar"), "Zm9vYmFy");
    }

    #[test]
    fn a_log_line_has_the_level_it_names() {
        let level = |line: &str| log("mapper", line, 0)["level"].as_u64();
        assert_eq!(level("12.5  WARN missed a grid version"), Some(3));
        assert_eq!(level("mapper: cannot open"), Some(4));
    }
}
