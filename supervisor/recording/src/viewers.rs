//! Messages for Foxglove and Lichtblick, in Foxglove's schemas as Protobuf
//! (<https://docs.foxglove.dev/docs/sdk/schemas>). Recordings and the live server share them.
//!
//! The schemas in `foxglove/` are those of Foxglove's SDK 0.30.3 (MIT licence). Tests of
//! `firsthand-foxglove`, which contains the SDK, compare them and decode the messages with it.

use common::{
    grid::{CellState, GridFrame},
    kinematics::Pose2,
    mission::{Mission, Sensor, SensorKind},
    samples::{GridHeader, Mover, PoseSample, RangeReading, RangeStatus, RangesHeader, ScanHeader},
    topics::{self, AnyTopic},
};
use robot_state::{RobotState, Sample};

use crate::protobuf::{Message, text_in};

const TRANSFORMS: &str = "foxglove/transforms";
const POSE: &str = "foxglove/pose";
const ODOMETRY: &str = "foxglove/odometry";
const GRID: &str = "foxglove/grid";
const SCENE: &str = "foxglove/scene";
const MOVERS: &str = "foxglove/movers";
pub const LOG: &str = "log";

const MAP: &str = "map";
/// Frame of the robot: its centre, x ahead. Each sensor's frame has its name.
const BASE: &str = "base_link";
/// Mission time between scenes and between maps, nanoseconds.
const EVERY_NS: u64 = 1_000_000_000;
/// Maximum cells per side of a drawn map; in a larger one a drawn cell covers several.
const MOST_A_SIDE: usize = 1024;
/// Names of a drawn cell's bytes: `state` is a [`CellState`], the others its default colour.
const CELL: [&str; 5] = ["state", "red", "green", "blue", "alpha"];

static DRAWN: [&dyn AnyTopic; 5] =
    [&topics::POSE, &topics::RANGES, &topics::SCAN, &topics::GRID, &topics::TARGET];

/// Channel for viewers, with messages and schema in the encoding `protobuf`.
#[derive(Debug)]
pub struct Channel {
    pub topic: String,
    /// Such as `foxglove.Grid`.
    pub schema: &'static str,
    /// Schema as a `FileDescriptorSet`.
    pub descriptors: &'static [u8],
}

pub type Sink<'a> = &'a mut dyn FnMut(&str, &[u8]);

macro_rules! channel {
    ($topic:expr, $name:literal) => {
        Channel {
            topic: $topic.to_owned(),
            schema: concat!("foxglove.", $name),
            descriptors: include_bytes!(concat!("../foxglove/", $name, ".bin")),
        }
    };
}

pub fn channels(mission: Option<&Mission>) -> Vec<Channel> {
    let fixed = [
        channel!(TRANSFORMS, "FrameTransforms"),
        channel!(POSE, "PoseInFrame"),
        channel!(ODOMETRY, "Odometry"),
        channel!(GRID, "Grid"),
        channel!(SCENE, "SceneUpdate"),
        channel!(MOVERS, "SceneUpdate"),
        channel!(LOG, "Log"),
    ];
    let sensors = mission.map(Mission::sensor_table).unwrap_or_default();
    let used = sensors.iter().filter(|sensor| sensor.used);
    fixed.into_iter().chain(used.map(|sensor| channel!(scan_topic(sensor), "LaserScan"))).collect()
}

fn scan_topic(sensor: &Sensor) -> String {
    format!("foxglove/scan/{}", sensor.name)
}

pub struct Drawn {
    mission: Option<Mission>,
    sensors: Vec<Sensor>,
    state: RobotState,
    grid_ns: Option<u64>,
    scene_ns: Option<u64>,
    has_movers: bool,
}

impl Drawn {
    pub fn new(mission: Option<Mission>) -> Self {
        Self {
            sensors: mission.as_ref().map(Mission::sensor_table).unwrap_or_default(),
            state: mission.as_ref().map(RobotState::of_mission).unwrap_or_default(),
            mission,
            grid_ns: None,
            scene_ns: None,
            has_movers: false,
        }
    }

    /// Passes the drawings of a `message` of `topic` to `sink`, at `now_ns` since 1970.
    ///
    /// Ignores unknown topics and malformed messages.
    pub fn message(&mut self, topic: &str, message: &[u8], now_ns: u64, sink: Sink<'_>) {
        let is_drawn = DRAWN.iter().any(|drawn| drawn.spec().name == topic);
        let Some(sample) = is_drawn.then(|| Sample::decoded(topic, message)).flatten() else {
            return;
        };
        self.state.apply(&sample);
        let time = time(now_ns);
        match &sample {
            Sample::Pose(pose) => draw_pose(pose, &time, sink),
            Sample::Ranges(header, readings) => self.ranges(header, readings, &time, sink),
            Sample::Scan(header, beams) => {
                let sensor = usize::try_from(header.sensor).ok();
                if let Some(sensor) = sensor.and_then(|row| self.sensors.get(row)) {
                    sink(&scan_topic(sensor), beams_of(sensor, header, beams, &time).bytes());
                }
            }
            Sample::Grid(header, _) => self.grid(header, &time, sink),
            _ => {}
        }
        // Events are not used here.
        self.state.take_events();
    }

    fn grid(&mut self, header: &GridHeader, time: &Message, sink: Sink<'_>) {
        let map = &self.state.map;
        if let Some(frame) = map.frame()
            && is_due(&mut self.grid_ns, header.stamp.stamp_ns)
        {
            sink(GRID, grid(frame, map.cells(), time).bytes());
        }
        let movers: Vec<_> = header.drawn_movers().collect();
        // Without movers an empty entity replaces the last ones.
        if std::mem::replace(&mut self.has_movers, !movers.is_empty()) || self.has_movers {
            sink(MOVERS, Message::default().part(2, &drawn_movers(&movers, time)).bytes());
        }
    }

    fn ranges(
        &mut self,
        header: &RangesHeader,
        readings: &[RangeReading],
        time: &Message,
        sink: Sink<'_>,
    ) {
        if is_due(&mut self.scene_ns, header.stamp.stamp_ns) {
            let mount = |sensor: &Sensor| {
                transform(time, BASE, &sensor.name, sensor.mount.on(Pose2::default()))
            };
            sink(TRANSFORMS, Message::default().parts(1, self.sensors.iter().map(mount)).bytes());
            sink(SCENE, self.scene(time).bytes());
        }
        for reading in readings {
            // A laser's beams have their own topic.
            if let Some(sensor) = self.sensors.get(usize::from(reading.sensor))
                && sensor.used
                && sensor.kind != SensorKind::Scan
                && reading.status() != RangeStatus::Absent
            {
                sink(&scan_topic(sensor), scan(sensor, reading, time).bytes());
            }
        }
    }

    /// Returns a `SceneUpdate`: trajectory, targets, body, and its place within two standard
    /// deviations.
    fn scene(&self, time: &Message) -> Message {
        let entity = |id: &str, frame: &str| entity(time, id, frame);
        // A `LinePrimitive` through all points.
        let trajectory = Message::default()
            .part(2, &pose(Pose2::default()))
            .number(3, 1.5)
            .integer(4, true.into())
            .parts(5, self.state.way.iter().map(|at| vector([at.x, at.y, 0.0])))
            .part(6, &vector([0.0, 0.3, 0.8, 1.0]));
        let believed = self.state.pose.unwrap_or_default();
        let (sigmas, axis) = believed.position_axes();
        let ellipse = Pose2 { heading: axis - believed.heading_rad, ..Pose2::default() };
        let mut discs = vec![disc(ellipse, sigmas.map(|sigma| 4.0 * sigma), [0.6, 0.2, 0.8, 0.4])];
        let mut entities = vec![entity("trajectory", MAP).part(11, &trajectory)];
        if let Some(mission) = &self.mission {
            let body = 2.0 * mission.body().radius_m;
            discs.push(disc(Pose2::default(), [body; 2], [0.2, 0.4, 0.9, 0.5]));
            let reached = 2.0 * mission.arrival_tolerance_m;
            let targets = self.state.targets().map(|at| {
                let at = Pose2 { position: at.position(), heading: 0.0 };
                disc(at, [reached; 2], [0.1, 0.7, 0.2, 0.6])
            });
            entities.push(entity("targets", MAP).parts(10, targets));
        }
        entities.push(entity("robot", BASE).parts(10, discs));
        Message::default().parts(2, entities)
    }
}

fn entity(time: &Message, id: &str, frame: &str) -> Message {
    framed(time, frame).text(3, id).integer(5, true.into())
}

/// Returns a `SceneEntity` of movers: discs, arrows to their places in 1 s, bounding discs, speeds.
fn drawn_movers(movers: &[&Mover], time: &Message) -> Message {
    let at =
        |mover: &Mover| Pose2 { position: mover.place(), heading: mover.velocity().to_angle() };
    let arrow = |mover: &&Mover| {
        Message::default()
            .part(1, &pose(at(mover)))
            .number(2, 0.8 * mover.velocity().length())
            .number(3, 0.06)
            .number(4, 0.2 * mover.velocity().length())
            .number(5, 0.15)
            .part(6, &vector([0.7, 0.1, 0.1, 1.0]))
    };
    let discs = movers.iter().flat_map(|mover| {
        let disc =
            |radius_m: f64, alpha| disc(at(mover), [2.0 * radius_m; 2], [0.8, 0.1, 0.1, alpha]);
        [disc(mover.radius_m.into(), 0.6), disc(mover.reach_m(), 0.2)]
    });
    let speed = |mover: &&Mover| {
        Message::default()
            .part(1, &pose(at(mover)))
            .integer(2, true.into())
            .number(3, 0.2)
            .part(5, &vector([0.5, 0.0, 0.0, 1.0]))
            .text(6, &format!("{:.1} m/s", mover.velocity().length()))
    };
    entity(time, "movers", MAP)
        .parts(7, movers.iter().map(arrow))
        .parts(10, discs)
        .parts(13, movers.iter().map(speed))
}

fn draw_pose(sample: &PoseSample, time: &Message, sink: Sink<'_>) {
    let at = sample.pose();
    let odometry = framed(time, MAP)
        .text(3, BASE)
        .part(4, &pose(at))
        .part(5, &vector([sample.v_m_s, 0.0, 0.0]))
        .part(6, &vector([0.0, 0.0, sample.omega_rad_s]))
        .numbers(7, sample.covariance_6x6().into_iter())
        .numbers(8, [0.0; 36].into_iter());
    sink(TRANSFORMS, Message::default().part(1, &transform(time, MAP, BASE, at)).bytes());
    sink(POSE, framed(time, MAP).part(3, &pose(at)).bytes());
    sink(ODOMETRY, odometry.bytes());
}

fn grid(frame: GridFrame, cells: &[u8], time: &Message) -> Message {
    let side = frame.cells as usize;
    let each = side.div_ceil(MOST_A_SIDE).max(1);
    let drawn = side.div_ceil(each);
    assert!(drawn <= MOST_A_SIDE && cells.len() == frame.area());
    let mut data = Vec::with_capacity(drawn * drawn * CELL.len());
    for row in 0..drawn {
        for col in 0..drawn {
            let inside = (row * each..side).take(each).flat_map(|row| {
                &cells[row * side..][..side][col * each..][..each.min(side - col * each)]
            });
            // A drawn cell is hazard if any of its cells is.
            let state = inside.max_by_key(|cell| CellState::from_byte(**cell).is_hazard());
            let state = CellState::from_byte(state.copied().unwrap_or_default());
            data.push(state as u8);
            data.extend(paint(state));
        }
    }
    assert_eq!(data.len(), drawn * drawn * CELL.len());
    let cell_m = frame.resolution_m * each as f64;
    const UINT8: u64 = 1;
    let field = |(offset, name): (u32, &str)| {
        Message::default().text(1, name).fixed(2, offset).integer(3, UINT8)
    };
    let corner = Pose2 { position: frame.corner(), heading: 0.0 };
    framed(time, MAP)
        .part(3, &pose(corner))
        .fixed(4, drawn as u32)
        .part(5, &Message::default().number(1, cell_m).number(2, cell_m))
        .fixed(6, (drawn * CELL.len()) as u32)
        .fixed(7, CELL.len() as u32)
        .parts(8, (0..).zip(CELL).map(field))
        .data(9, &data)
}

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

/// Returns a `LaserScan`. A sonar's echo covers the whole arc, a ray's its end. A reading without
/// an echo has no points.
fn scan(sensor: &Sensor, reading: &RangeReading, time: &Message) -> Message {
    let half = sensor.field_of_view_deg.to_radians() / 2.0;
    // Viewers divide by the number of angles between points, so a ray has two points.
    let points = match (reading.status(), sensor.kind) {
        (RangeStatus::Measured, SensorKind::Cone) => 9,
        (RangeStatus::Measured, SensorKind::Ray) => 2,
        _ => 0,
    };
    laser_scan(sensor, [-half, half], (0..points).map(|_| reading.range_m), time)
}

/// Returns a laser's beams. Those without an end have infinite range, as viewers expect.
fn beams_of(sensor: &Sensor, header: &ScanHeader, beams: &[f32], time: &Message) -> Message {
    let first = header.first_rad - sensor.mount.looks_rad();
    let last = first + header.step_rad * beams.len().saturating_sub(1) as f64;
    laser_scan(sensor, [first, last], beams.iter().copied().map(f64::from), time)
}

fn laser_scan(
    sensor: &Sensor,
    [first, last]: [f64; 2],
    ranges: impl Iterator<Item = f64>,
    time: &Message,
) -> Message {
    framed(time, &sensor.name)
        .part(3, &pose(Pose2::default()))
        .number(4, first)
        .number(5, last)
        .numbers(6, ranges)
}

/// `line` was read at `now_ns` since 1970.
pub fn log(process: &str, line: &str, now_ns: u64) -> Vec<u8> {
    Message::default()
        .part(1, &time(now_ns))
        .integer(2, level(line))
        .text(LOG_MESSAGE, line)
        .text(LOG_NAME, process)
        .into_bytes()
}

const LOG_MESSAGE: u64 = 3;
const LOG_NAME: u64 = 4;

/// Returns a line's level in Foxglove's schema. Lines without a level explain a process's end, so
/// they are errors.
fn level(line: &str) -> u64 {
    let levels = ["DEBUG", "INFO", "WARN", "ERROR"];
    (1..)
        .zip(levels)
        .find(|(_, level)| line.split_whitespace().take(3).any(|word| word == *level))
        .map_or(4, |(number, _)| number)
}

/// Returns process and text of a `log` message, JSON in older recordings.
pub fn log_line(message: &[u8]) -> Option<(String, String)> {
    if message.first() == Some(&b'{') {
        let fields: serde_json::Value = serde_json::from_slice(message).ok()?;
        let text = |key: &str| fields.get(key)?.as_str().map(str::to_owned);
        return Some((text("name")?, text("message")?));
    }
    Some((text_in(message, LOG_NAME)?, text_in(message, LOG_MESSAGE)?))
}

fn is_due(last: &mut Option<u64>, now: u64) -> bool {
    let due = last.is_none_or(|last| now.saturating_sub(last) >= EVERY_NS || now < last);
    if due {
        *last = Some(now);
    }
    due
}

fn time(ns: u64) -> Message {
    Message::default().integer(1, ns / 1_000_000_000).integer(2, ns % 1_000_000_000)
}

fn framed(time: &Message, frame: &str) -> Message {
    Message::default().part(1, time).text(2, frame)
}

fn transform(time: &Message, parent: &str, child: &str, at: Pose2) -> Message {
    framed(time, parent)
        .text(3, child)
        .part(4, &vector([at.position.x, at.position.y, 0.0]))
        .part(5, &rotation(at.heading))
}

fn pose(at: Pose2) -> Message {
    let position = vector([at.position.x, at.position.y, 0.0]);
    Message::default().part(1, &position).part(2, &rotation(at.heading))
}

fn rotation(heading: f64) -> Message {
    let (z, w) = (heading / 2.0).sin_cos();
    Message::default().number(3, z).number(4, w)
}

/// Encodes a `Vector3`, a `Point3` or a `Color`.
fn vector<const PARTS: usize>(parts: [f64; PARTS]) -> Message {
    (1..).zip(parts).fold(Message::default(), |vector, (field, part)| vector.number(field, part))
}

/// Returns a flat ellipse of these widths, a `CylinderPrimitive`.
fn disc(at: Pose2, [x, y]: [f64; 2], painted: [f64; 4]) -> Message {
    Message::default()
        .part(1, &pose(at))
        .part(2, &vector([x, y, 0.01]))
        .number(3, 1.0)
        .number(4, 1.0)
        .part(5, &vector(painted))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_line_has_the_level_it_names_and_is_read_from_both_encodings() {
        let text = "12.5  WARN missed a grid version";
        assert_eq!([text, "mapper: cannot open"].map(level), [3, 4]);
        let line = Some(("mapper".to_owned(), text.to_owned()));
        assert_eq!(log_line(&log("mapper", text, 7)), line);
        let json = br#"{"level":3,"message":"12.5  WARN missed a grid version","name":"mapper"}"#;
        assert_eq!(log_line(json), line);
        assert_eq!(log_line(b"{"), None);
        assert_eq!(log_line(&[0xff]), None);
    }

    #[test]
    fn a_large_map_is_drawn_with_fewer_cells_and_every_hazard() {
        let frame = GridFrame { cells: 2500, resolution_m: 0.1, centre: Pose2::default().position };
        let mut cells = vec![CellState::Scanned as u8; frame.area()];
        cells[2499 * 2500 + 2499] = CellState::Known as u8;
        let drawn = grid(frame, &cells, &Message::default());
        let data = &drawn.bytes()[drawn.bytes().len() - 834 * 834 * CELL.len()..];
        let states: Vec<u8> = data.iter().step_by(CELL.len()).copied().collect();
        let hazards: Vec<usize> =
            (0..states.len()).filter(|&at| states[at] == CellState::Known as u8).collect();
        assert_eq!(hazards, [834 * 834 - 1]);
    }
}
