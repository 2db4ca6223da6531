//! Messages that Foxglove and Lichtblick draw, in Foxglove's schemas as Protobuf (<https://docs.foxglove.dev/docs/sdk/schemas>).
//! Recordings and the live server have the same.

use std::collections::BTreeMap;

use common::{
    bus::{decode_sample, decode_slice},
    grid::{Cell, CellState, GridFrame, Replica},
    kinematics::Pose2,
    mission::{Mission, Sensor, SensorKind},
    samples::{
        GridHeader, PoseSample, RangeReading, RangeStatus, RangesHeader, ScanHeader, TargetSample,
    },
    topics,
};
use foxglove::{
    Decode as _, Encode, Schema,
    messages::{
        Color, CylinderPrimitive, FrameTransform, FrameTransforms, Grid, LaserScan, LinePrimitive,
        Log, Odometry, PackedElementField, Point3, Pose, PoseInFrame, Quaternion, SceneEntity,
        SceneUpdate, Timestamp, Vector2, Vector3, packed_element_field::NumericType,
    },
};

use crate::downsampled::Downsampled;

const TRANSFORMS: &str = "foxglove/transforms";
const POSE: &str = "foxglove/pose";
const ODOMETRY: &str = "foxglove/odometry";
const GRID: &str = "foxglove/grid";
const SCENE: &str = "foxglove/scene";
pub(crate) const LOG: &str = "log";

/// The mission's frame.
const MAP: &str = "map";
/// The frame of the robot: its centre, x ahead. Each sensor has a frame of its name.
const BASE: &str = "base";
/// Mission time between scenes and between maps, nanoseconds.
const EVERY_NS: u64 = 1_000_000_000;
/// The most points of the trajectory that are drawn. From a longer one every second, fourth, ... point is drawn.
const TRAJECTORY: usize = 1000;
/// The most cells a side of a drawn map; in a larger one a cell stands for several.
const MOST_A_SIDE: usize = 1024;
/// The bytes of a drawn cell and their names. `state` is a [`CellState`]; viewers use the other four as its colour by default.
const CELL: [&str; 5] = ["state", "red", "green", "blue", "alpha"];

/// A channel for viewers: topic, schema, encoding of its messages.
pub(crate) type Channel = (String, Schema, String);
/// Takes a message: topic and content.
pub(crate) type Sink<'a> = &'a mut dyn FnMut(&str, &[u8]);

pub(crate) fn channels(mission: Option<&Mission>) -> Vec<Channel> {
    fn channel<M: Encode>(topic: impl Into<String>) -> Option<Channel> {
        Some((topic.into(), M::get_schema()?, M::get_message_encoding()))
    }
    let fixed = [
        channel::<FrameTransforms>(TRANSFORMS),
        channel::<PoseInFrame>(POSE),
        channel::<Odometry>(ODOMETRY),
        channel::<Grid>(GRID),
        channel::<SceneUpdate>(SCENE),
        channel::<Log>(LOG),
    ];
    let sensors = mission.map(Mission::sensor_table).unwrap_or_default();
    let used = sensors.iter().filter(|sensor| sensor.used);
    let scans = used.map(|sensor| channel::<LaserScan>(scan_topic(sensor)));
    fixed.into_iter().chain(scans).flatten().collect()
}

fn scan_topic(sensor: &Sensor) -> String {
    format!("foxglove/scan/{}", sensor.name)
}

fn send(sink: Sink<'_>, topic: &str, message: &impl Encode) {
    let mut bytes = Vec::with_capacity(message.encoded_len().unwrap_or_default());
    // A Vec has room for any message.
    if message.encode(&mut bytes).is_ok() {
        sink(topic, &bytes);
    }
}

/// The drawings of a run for viewers.
pub(crate) struct Drawn {
    mission: Option<Mission>,
    sensors: Vec<Sensor>,
    grid: Replica<u8>,
    grid_ns: Option<u64>,
    scene_ns: Option<u64>,
    pose: PoseSample,
    target: Option<TargetSample>,
    trajectory: Downsampled<Point3, TRAJECTORY>,
}

impl Drawn {
    pub(crate) fn new(mission: Option<Mission>) -> Self {
        Self {
            sensors: mission.as_ref().map(Mission::sensor_table).unwrap_or_default(),
            target: mission.as_ref().map(TargetSample::first),
            mission,
            grid: Replica::default(),
            grid_ns: None,
            scene_ns: None,
            pose: PoseSample::default(),
            trajectory: Downsampled::default(),
        }
    }

    /// Give `sink` the drawings of a `message` of `topic` that was read at `now_ns` since 1970. Viewers play messages by that time,
    /// which is not mission time in lockstep. None if the message does not match its topic; other topics are not drawn.
    pub(crate) fn take(
        &mut self,
        topic: &str,
        message: &[u8],
        now_ns: u64,
        sink: Sink<'_>,
    ) -> Option<()> {
        if topic == topics::POSE.spec().name {
            self.pose(&decode_sample(message)?, now_ns, sink);
        } else if topic == topics::RANGES.spec().name {
            let (header, readings) = decode_slice(message)?;
            self.ranges(&header, &readings, now_ns, sink);
        } else if topic == topics::SCAN.spec().name {
            let (header, beams) = decode_slice::<ScanHeader, f32>(message)?;
            if let Some(sensor) = self.sensors.get(usize::try_from(header.sensor).ok()?) {
                send(sink, &scan_topic(sensor), &beams_of(sensor, &header, &beams, time(now_ns)));
            }
        } else if topic == topics::GRID.spec().name {
            let (header, cells) = decode_slice(message)?;
            self.grid(&header, &cells, now_ns, sink);
        } else if topic == topics::TARGET.spec().name {
            self.target = Some(decode_sample(message)?);
        }
        Some(())
    }

    fn pose(&mut self, sample: &PoseSample, now_ns: u64, sink: Sink<'_>) {
        self.pose = *sample;
        self.trajectory.push(point(sample.x_m, sample.y_m));
        let timestamp = time(now_ns);
        let pose = pose(sample.pose());
        let odometry = Odometry {
            timestamp,
            frame_id: MAP.to_owned(),
            body_frame_id: BASE.to_owned(),
            pose,
            linear_velocity: Some(Vector3 { x: sample.v_m_s, y: 0.0, z: 0.0 }),
            angular_velocity: Some(Vector3 { x: 0.0, y: 0.0, z: sample.omega_rad_s }),
            pose_covariance: sample.covariance_6x6().to_vec(),
            velocity_covariance: vec![0.0; 36],
            ..Odometry::default()
        };
        let transforms = vec![transform(timestamp, MAP, BASE, sample.pose())];
        send(sink, TRANSFORMS, &FrameTransforms { transforms });
        send(sink, POSE, &PoseInFrame { timestamp, frame_id: MAP.to_owned(), pose });
        send(sink, ODOMETRY, &odometry);
    }

    fn grid(&mut self, header: &GridHeader, cells: &[u8], now_ns: u64, sink: Sink<'_>) {
        let _ = self.grid.apply(&header.part, cells);
        if let Some(frame) = self.grid.frame()
            && is_due(&mut self.grid_ns, header.stamp.stamp_ns)
        {
            send(sink, GRID, &grid(frame, self.grid.cells(), time(now_ns)));
        }
    }

    fn ranges(
        &mut self,
        header: &RangesHeader,
        readings: &[RangeReading],
        now_ns: u64,
        sink: Sink<'_>,
    ) {
        let timestamp = time(now_ns);
        if is_due(&mut self.scene_ns, header.stamp.stamp_ns) {
            let mount = |sensor: &Sensor| {
                transform(timestamp, BASE, &sensor.name, sensor.mount.on(Pose2::default()))
            };
            let transforms = self.sensors.iter().map(mount).collect();
            send(sink, TRANSFORMS, &FrameTransforms { transforms });
            send(sink, SCENE, &self.scene(timestamp));
        }
        for reading in readings {
            let sensor = self.sensors.get(usize::from(reading.sensor));
            // The beams of a laser are a topic of their own.
            if let Some(sensor) = sensor.filter(|sensor| sensor.used)
                && sensor.kind != SensorKind::Scan
                && reading.status() != RangeStatus::Absent
            {
                send(sink, &scan_topic(sensor), &scan(sensor, reading, timestamp));
            }
        }
    }

    /// The trajectory, the targets, the body, and its place within two standard deviations.
    fn scene(&self, timestamp: Option<Timestamp>) -> SceneUpdate {
        let entity = |id: &str, frame: &str| SceneEntity {
            timestamp,
            frame_id: frame.to_owned(),
            id: id.to_owned(),
            frame_locked: true,
            ..SceneEntity::default()
        };
        let trajectory = LinePrimitive {
            pose: pose(Pose2::default()),
            thickness: 1.5,
            scale_invariant: true,
            points: self.trajectory.items().to_vec(),
            color: color([0.0, 0.3, 0.8, 1.0]),
            ..LinePrimitive::default()
        };
        let mut entities =
            vec![SceneEntity { lines: vec![trajectory], ..entity("trajectory", MAP) }];
        let (sigmas, axis) = self.pose.position_axes();
        let heading = axis - self.pose.heading_rad;
        let mut discs = vec![disc(
            Pose2 { heading, ..Pose2::default() },
            sigmas.map(|sigma| 4.0 * sigma),
            [0.6, 0.2, 0.8, 0.4],
        )];
        if let Some(mission) = &self.mission {
            let body = 2.0 * mission.body().radius_m;
            discs.push(disc(Pose2::default(), [body; 2], [0.2, 0.4, 0.9, 0.5]));
            let reached = 2.0 * mission.arrival_tolerance_m;
            let targets = self.target.iter();
            let targets =
                targets.flat_map(|sent| [&sent.target].into_iter().chain(sent.ahead())).map(|at| {
                    let at = Pose2 { position: at.position(), heading: 0.0 };
                    disc(at, [reached; 2], [0.1, 0.7, 0.2, 0.6])
                });
            entities.push(SceneEntity { cylinders: targets.collect(), ..entity("targets", MAP) });
        }
        entities.push(SceneEntity { cylinders: discs, ..entity("robot", BASE) });
        SceneUpdate { entities, ..SceneUpdate::default() }
    }
}

fn grid(frame: GridFrame, cells: &[u8], timestamp: Option<Timestamp>) -> Grid {
    let side = frame.cells as usize;
    let each = side.div_ceil(MOST_A_SIDE).max(1);
    let drawn = side.div_ceil(each);
    let mut data = Vec::with_capacity(drawn * drawn * CELL.len());
    for row in 0..drawn {
        for col in 0..drawn {
            let rows = (row * each..side).take(each);
            let inside = rows.flat_map(|row| {
                &cells[row * side..][..side][col * each..][..each.min(side - col * each)]
            });
            // A drawn cell is hazard if any of its cells is.
            let state = inside.max_by_key(|cell| CellState::from_byte(**cell).is_hazard());
            let state = CellState::from_byte(state.copied().unwrap_or_default());
            data.push(state as u8);
            data.extend(paint(state));
        }
    }
    let cell_m = frame.resolution_m * each as f64;
    let field = |(offset, name): (u32, &str)| PackedElementField {
        name: name.to_owned(),
        offset,
        r#type: NumericType::Uint8.into(),
    };
    Grid {
        timestamp,
        frame_id: MAP.to_owned(),
        pose: pose(Pose2 { position: frame.corner_of(Cell { col: 0, row: 0 }), heading: 0.0 }),
        column_count: drawn as u32,
        cell_size: Some(Vector2 { x: cell_m, y: cell_m }),
        row_stride: (drawn * CELL.len()) as u32,
        cell_stride: CELL.len() as u32,
        fields: (0..).zip(CELL).map(field).collect(),
        data: data.into(),
    }
}

/// The colour of a state: red, green, blue, alpha.
const fn paint(state: CellState) -> [u8; 4] {
    match state {
        CellState::Free => [0; 4],
        CellState::Scanned => [190, 215, 190, 255],
        CellState::Margin => [245, 200, 150, 255],
        CellState::Sensed => [225, 120, 20, 255],
        CellState::Known => [80, 80, 80, 255],
        CellState::Perimeter => [130, 130, 130, 255],
    }
}

/// A sonar's echo comes from the whole arc; a ray's from its end. A reading without an echo has no points.
fn scan(sensor: &Sensor, reading: &RangeReading, timestamp: Option<Timestamp>) -> LaserScan {
    let half = sensor.field_of_view_deg.to_radians() / 2.0;
    // Viewers divide by the number of angles between points, so a ray has two of them.
    let points = match (reading.status(), sensor.kind) {
        (RangeStatus::Measured, SensorKind::Cone) => 9,
        (RangeStatus::Measured, SensorKind::Ray) => 2,
        _ => 0,
    };
    LaserScan {
        timestamp,
        frame_id: sensor.name.clone(),
        pose: pose(Pose2::default()),
        start_angle: -half,
        end_angle: half,
        ranges: vec![reading.range_m; points],
        intensities: Vec::new(),
    }
}

/// The beams of a laser; those without an end have the range infinity, as viewers expect it.
fn beams_of(
    sensor: &Sensor,
    header: &ScanHeader,
    beams: &[f32],
    timestamp: Option<Timestamp>,
) -> LaserScan {
    let start_angle = header.first_rad - sensor.mount.looks_rad();
    LaserScan {
        timestamp,
        frame_id: sensor.name.clone(),
        pose: pose(Pose2::default()),
        start_angle,
        end_angle: start_angle + header.step_rad * beams.len().saturating_sub(1) as f64,
        ranges: beams.iter().copied().map(f64::from).collect(),
        intensities: Vec::new(),
    }
}

pub(crate) fn log(process: &str, line: &str, now_ns: u64, sink: Sink<'_>) {
    let log = Log {
        timestamp: time(now_ns),
        level: level(line),
        message: line.to_owned(),
        name: process.to_owned(),
        ..Log::default()
    };
    send(sink, LOG, &log);
}

/// The number of a line's level in Foxglove's schema. Lines without a level say why a process ended, so they are errors.
fn level(line: &str) -> i32 {
    let levels = ["DEBUG", "INFO", "WARN", "ERROR"];
    let named = (1..)
        .zip(levels)
        .find(|(_, level)| line.split_whitespace().take(3).any(|word| word == *level));
    named.map_or(4, |(number, _)| number)
}

/// The process and the text of a message of the channel `log`. Older recordings have JSON.
pub fn log_line(message: &[u8]) -> Option<(String, String)> {
    if message.first() == Some(&b'{') {
        let mut fields: BTreeMap<String, serde_json::Value> =
            serde_json::from_slice(message).ok()?;
        let mut text = |key| fields.remove(key)?.as_str().map(str::to_owned);
        return Some((text("name")?, text("message")?));
    }
    Log::decode(message).ok().map(|log| (log.name, log.message))
}

fn is_due(last: &mut Option<u64>, now: u64) -> bool {
    let due = last.is_none_or(|last| now.saturating_sub(last) >= EVERY_NS || now < last);
    if due {
        *last = Some(now);
    }
    due
}

fn time(ns: u64) -> Option<Timestamp> {
    let seconds = u32::try_from(ns / 1_000_000_000).ok()?;
    Timestamp::new_checked(seconds, (ns % 1_000_000_000) as u32)
}

fn transform(timestamp: Option<Timestamp>, parent: &str, child: &str, at: Pose2) -> FrameTransform {
    FrameTransform {
        timestamp,
        parent_frame_id: parent.to_owned(),
        child_frame_id: child.to_owned(),
        translation: Some(Vector3 { x: at.position.x, y: at.position.y, z: 0.0 }),
        rotation: Some(rotation(at.heading)),
    }
}

fn pose(at: Pose2) -> Option<Pose> {
    let position = Some(Vector3 { x: at.position.x, y: at.position.y, z: 0.0 });
    Some(Pose { position, orientation: Some(rotation(at.heading)) })
}

fn rotation(heading: f64) -> Quaternion {
    let (z, w) = (heading / 2.0).sin_cos();
    Quaternion { x: 0.0, y: 0.0, z, w }
}

const fn point(x: f64, y: f64) -> Point3 {
    Point3 { x, y, z: 0.0 }
}

const fn color([r, g, b, a]: [f64; 4]) -> Option<Color> {
    Some(Color { r, g, b, a })
}

/// A flat ellipse of these widths.
fn disc(at: Pose2, [x, y]: [f64; 2], painted: [f64; 4]) -> CylinderPrimitive {
    CylinderPrimitive {
        pose: pose(at),
        size: Some(Vector3 { x, y, z: 0.01 }),
        bottom_scale: 1.0,
        top_scale: 1.0,
        color: color(painted),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_line_has_the_level_it_names_and_is_read_from_both_encodings() {
        let mut sent = Vec::new();
        log("mapper", "12.5  WARN missed a grid version", 7, &mut |topic, message| {
            sent.push((topic.to_owned(), message.to_vec()));
        });
        let [(topic, message)] = &sent[..] else {
            panic!("{sent:?}");
        };
        assert_eq!(topic, LOG);
        assert_eq!(Log::decode(&message[..]).unwrap().level, 3);
        assert_eq!(level("mapper: cannot open"), 4);
        let line = ("mapper".to_owned(), "12.5  WARN missed a grid version".to_owned());
        assert_eq!(log_line(message).as_ref(), Some(&line));
        let json = br#"{"level":3,"message":"12.5  WARN missed a grid version","name":"mapper"}"#;
        assert_eq!(log_line(json), Some(line));
        assert_eq!(log_line(b"{"), None);
        assert_eq!(log_line(&[0xff]), None);
    }

    #[test]
    fn a_large_map_is_drawn_with_fewer_cells_and_every_hazard() {
        let frame = GridFrame { cells: 2500, resolution_m: 0.1, centre: Pose2::default().position };
        let mut cells = vec![CellState::Scanned as u8; frame.area()];
        cells[2499 * 2500 + 2499] = CellState::Known as u8;
        let drawn = grid(frame, &cells, None);
        assert_eq!(drawn.column_count, 834);
        assert_eq!(drawn.data.len(), 834 * 834 * CELL.len());
        let states: Vec<u8> = drawn.data.iter().step_by(CELL.len()).copied().collect();
        let hazards: Vec<usize> =
            (0..states.len()).filter(|&at| states[at] == CellState::Known as u8).collect();
        assert_eq!(hazards, [834 * 834 - 1]);
        assert!((drawn.cell_size.unwrap().x - 0.3).abs() < 1e-9);
    }
}
