//! Messages that show a robot: samples in, messages out. Pure.

use std::f64::consts::TAU;

use common::{
    grid::{Cell, CellState, GridFrame},
    kinematics::Pose2,
    mission::{Mission, Sensor, SensorKind},
    samples::{
        Action, Cause, FieldCell, FieldHeader, GridHeader, Mover, PoseSample, RangeReading,
        RangeStatus, RosterEntry, ScanHeader, StageState, Sweep, TargetPoint, name_str,
    },
};
use glam::{DAffine2, DVec2};
use robot_state::{Kind, RobotState, Sample, death_in_words, failsafe_in_words};
use ros2::{
    cdr::Cdr as _,
    messages::{battery, odometry, scan},
    msg::{
        Clock, DiagnosticArray, DiagnosticStatus, Header, KeyValue, Log, MapMetaData, Marker,
        OccupancyGrid, OccupancyGridUpdate, PoseWithCovariance, PoseWithCovarianceStamped, Range,
    },
    parts::Pose,
};

use crate::{
    drift::Drift,
    messages::{disc, lines, markers, path, transforms, within},
    topics::Id,
};

/// Frames of the mission, of odometry, and of the robot, whose x is forward.
pub const MAP: &str = "map";
pub const ODOM: &str = "odom";
pub const BASE: &str = "base_link";

/// Wall-clock interval of whole maps and of unchanged diagnostics, nanoseconds.
const EVERY_NS: u64 = 1_000_000_000;
/// Most field directions drawn along a side.
const ARROWS: usize = 48;
/// Most path steps per cell of a side.
const STEPS_A_CELL: usize = 8;
/// Steps of half a cell between two poses of a path.
const POSE_EVERY: usize = 4;

pub type Sink<'a> = &'a mut dyn FnMut(Id, Vec<u8>);

#[derive(Debug)]
pub struct Shown {
    robot: String,
    pub mission: Mission,
    sensors: Vec<Sensor>,
    pub state: RobotState,
    /// Version and time of the last published whole map.
    map: Option<(u64, u64)>,
    has_movers: bool,
    diagnosed: Option<(Vec<DiagnosticStatus>, u64)>,
    drift: Drift,
    /// Mission time over the time of stamps.
    pub pace: f64,
    /// Pose in another node's `odom`: outer `None` if `odom` is ours, inner `None` before its first
    /// transform.
    pub others_odom: Option<Option<DAffine2>>,
}

impl Shown {
    pub fn new(robot: String, mission: Mission) -> Self {
        Self {
            robot,
            sensors: mission.sensor_table(),
            state: RobotState::of_mission(&mission),
            mission,
            map: None,
            has_movers: false,
            diagnosed: None,
            drift: Drift::NONE,
            pace: 1.0,
            others_odom: None,
        }
    }

    pub fn sensor_topics(&self) -> impl Iterator<Item = (Id, &str)> {
        let used = self.sensors.iter().enumerate().filter(|(_, sensor)| sensor.used);
        let is_scan = |(_, sensor): &(usize, &Sensor)| sensor.kind == SensorKind::Scan;
        let is_alone = used.clone().filter(is_scan).count() == 1;
        used.map(move |(row, sensor)| match sensor.kind {
            SensorKind::Scan => (Id::Scan(row), if is_alone { "" } else { &sensor.name }),
            _ => (Id::Range(row), sensor.name.as_str()),
        })
    }

    pub fn mounting(&self, now_ns: u64, sink: Sink<'_>) {
        let mounts: Vec<_> = self
            .sensors
            .iter()
            .filter(|sensor| sensor.used)
            .map(|sensor| (BASE, sensor.name.as_str(), plane(sensor.mount.on(Pose2::default()))))
            .collect();
        sink(Id::TfStatic, transforms(now_ns, &mounts));
    }

    pub fn sample(&mut self, sample: &Sample, now_ns: u64, sink: Sink<'_>) {
        if !self.state.apply(sample) {
            return;
        }
        match sample {
            Sample::Pose(pose) => self.pose(pose, now_ns, sink),
            Sample::Ranges(_, readings) => self.ranges(readings, now_ns, sink),
            Sample::Scan(header, beams) => self.scan(header, beams, now_ns, sink),
            Sample::Grid(header, cells) => self.grid(header, cells, now_ns, sink),
            Sample::Field(header, _) => self.field(header, now_ns, sink),
            Sample::Power(power) => {
                sink(Id::Battery, battery(Header::at(now_ns, BASE), power.motor_v));
            }
            _ => {}
        }
    }

    fn pose(&mut self, sample: &PoseSample, now_ns: u64, sink: Sink<'_>) {
        let pose = plane(sample.pose());
        let odom = plane(sample.odometry());
        match self.others_odom {
            None => {
                let frames = [(MAP, ODOM, sample.map_from_odom), (ODOM, BASE, odom)];
                sink(Id::Tf, transforms(now_ns, &frames));
            }
            Some(Some(robot)) => {
                let Pose2 { position, heading } = sample.pose();
                let origin = DAffine2::from_angle_translation(heading, position) * robot.inverse();
                let [x, y] = origin.translation.to_array();
                let origin = [x, y, origin.matrix2.x_axis.to_angle()];
                sink(Id::Tf, transforms(now_ns, &[(MAP, ODOM, origin)]));
            }
            Some(None) => {}
        }
        let pose = PoseWithCovariance { pose: pose.into(), covariance: sample.covariance_6x6() };
        let header = Header::at(now_ns, MAP);
        sink(Id::Pose, PoseWithCovarianceStamped { header, pose }.encode());
        let [of_pose, of_speeds] = self.drift.after(sample, &self.mission, self.pace);
        let speeds = [sample.v_m_s, sample.omega_rad_s].map(|speed| speed * self.pace);
        let header = Header::at(now_ns, ODOM);
        sink(Id::Odom, odometry(header, BASE, (odom, of_pose), (speeds, of_speeds)));
        sink(Id::Clock, Clock { clock: sample.stamp.stamp_ns.into() }.encode());
    }

    fn ranges(&self, readings: &[RangeReading], now_ns: u64, sink: Sink<'_>) {
        for reading in readings {
            let row = usize::from(reading.sensor);
            let is_shown = |sensor: &&Sensor| sensor.used && sensor.kind != SensorKind::Scan;
            let Some(sensor) = self.sensors.get(row).filter(is_shown) else {
                continue;
            };
            let range = match reading.status() {
                RangeStatus::Measured => reading.range_m,
                RangeStatus::AtContact => f64::NEG_INFINITY,
                RangeStatus::Nothing => f64::INFINITY,
                RangeStatus::Invalid => f64::NAN,
                RangeStatus::Absent => continue,
            };
            let limits = [sensor.model.product().least_m, sensor.reach_m];
            let [min_range, max_range] = limits.map(|limit| limit as f32);
            let message = Range {
                header: Header::at(now_ns, &sensor.name),
                radiation_type: match sensor.kind {
                    SensorKind::Cone => Range::ULTRASOUND,
                    _ => Range::INFRARED,
                },
                field_of_view: sensor.field_of_view_deg.to_radians().min(TAU) as f32,
                min_range,
                max_range,
                range: within(limits, range) as f32,
                ..Range::default()
            };
            sink(Id::Range(row), message.encode());
        }
    }

    fn scan(&self, header: &ScanHeader, beams: &[f32], now_ns: u64, sink: Sink<'_>) {
        let row = usize::try_from(header.sensor).unwrap_or(usize::MAX);
        if let Some(sensor) = self.sensors.get(row) {
            let period_s = sensor.every_ticks as f64 / self.mission.robot.rate_hz / self.pace;
            // Only beams in the order of measurement have beam times.
            let mut sweep = header.sweep();
            if !sweep.is_plausible(beams.len()) {
                sweep = Sweep::default();
            }
            let (mut after_tick_ns, mut beam_ns) = (sweep.first_beam_ns, sweep.beam_ns);
            if beam_ns < 0 || sweep.first_beam > 0 {
                (after_tick_ns, beam_ns) = (sweep.middle_ns(beams.len()), 0);
            }
            let beam_s = beam_ns as f64 * 1e-9 / self.pace;
            let at_ns = now_ns.saturating_add_signed((after_tick_ns as f64 / self.pace) as i64);
            let fan = [header.first_rad - sensor.mount.looks_rad(), header.step_rad];
            let limits = [sensor.model.product().least_m, header.reach_m];
            let header = Header::at(at_ns, &sensor.name);
            let told = beams.iter().map(|range| within(limits, f64::from(*range)) as f32).collect();
            sink(Id::Scan(row), scan(header, fan, limits, [beam_s, period_s], told));
        }
    }

    fn grid(&mut self, header: &GridHeader, cells: &[u8], now_ns: u64, sink: Sink<'_>) {
        let window = header.part.window();
        let is_whole = header.part.frame().whole() == window;
        if self.map.is_some() && !is_whole && window.area() > 0 {
            let update = OccupancyGridUpdate {
                header: Header::at(now_ns, MAP),
                x: window.col as i32,
                y: window.row as i32,
                width: window.width,
                height: window.height,
                data: cells.iter().copied().map(occupancy).collect(),
            };
            sink(Id::MapUpdates, update.encode());
        }
        let movers: Vec<_> = (0..).zip(header.drawn_movers()).flat_map(mover).collect();
        // After the last mover, an empty array deletes the markers.
        if std::mem::replace(&mut self.has_movers, !movers.is_empty()) || self.has_movers {
            sink(Id::Movers, markers(&Header::at(now_ns, MAP), movers));
        }
    }

    fn map(&mut self, now_ns: u64, sink: Sink<'_>) {
        let version = self.state.map.version();
        let is_due = self.map.is_none_or(|(published, at_ns)| {
            published != version && now_ns.saturating_sub(at_ns) >= EVERY_NS
        });
        if let Some(frame) = self.state.map.frame()
            && is_due
        {
            self.map = Some((version, now_ns));
            let [x, y] = frame.corner().to_array();
            let info = MapMetaData {
                map_load_time: now_ns.into(),
                resolution: frame.resolution_m as f32,
                width: frame.cells,
                height: frame.cells,
                origin: [x, y, 0.0].into(),
            };
            let data = self.state.map.cells().iter().copied().map(occupancy).collect();
            let header = Header::at(now_ns, MAP);
            sink(Id::Map, OccupancyGrid { header, info, data }.encode());
        }
    }

    fn field(&self, header: &FieldHeader, now_ns: u64, sink: Sink<'_>) {
        let Some(frame) = self.state.field.frame() else {
            return;
        };
        let to = DVec2::new(header.target_x_m, header.target_y_m);
        let header = Header::at(now_ns, MAP);
        let from = self.state.pose.unwrap_or_default().pose().position;
        let cells = self.state.field.cells();
        sink(Id::Path, path(header.clone(), &way(frame, cells, from, to)).encode());
        let drawn = [vec![directions(frame, cells)], self.targets()].concat();
        sink(Id::Field, markers(&header, drawn));
    }

    fn targets(&self) -> Vec<Marker> {
        let across = 2.0 * self.mission.arrival_tolerance_m;
        let target = |(id, target): (i32, &TargetPoint)| {
            let pose = [target.x_m, target.y_m, target.heading_rad];
            disc(("targets", id), pose, across, [0.1, 0.7, 0.2, 0.6])
        };
        (0..).zip(self.state.targets()).map(target).collect()
    }

    /// Publishes the map, events, and diagnostics if changed or due.
    pub fn tick(&mut self, now_ns: u64, sink: Sink<'_>) {
        self.map(now_ns, sink);
        for event in self.state.take_events() {
            let level = match event.kind {
                Kind::Bad => Log::ERROR,
                Kind::Warn => Log::WARN,
                Kind::Good | Kind::Note => Log::INFO,
                Kind::Log => Log::DEBUG,
            };
            let (stamp, name, msg) = (now_ns.into(), event.of, event.text);
            sink(Id::Rosout, Log { stamp, level, name, msg, ..Log::default() }.encode());
        }
        let statuses = self.statuses();
        let is_due = self.diagnosed.as_ref().is_none_or(|(before, at_ns)| {
            let age_ns = now_ns.saturating_sub(*at_ns);
            age_ns >= EVERY_NS || judged(before).ne(judged(&statuses))
        });
        if is_due {
            let (header, status) = (Header::at(now_ns, ""), statuses.clone());
            sink(Id::Diagnostics, DiagnosticArray { header, status }.encode());
            self.diagnosed = Some((statuses, now_ns));
        }
    }

    fn statuses(&self) -> Vec<DiagnosticStatus> {
        let link = self.state.link.unwrap_or_default();
        let level = match (link.action(), link.cause()) {
            (_, Cause::None | Cause::NotOrdered | Cause::MissionOver | Cause::OperatorStop) => {
                DiagnosticStatus::OK
            }
            (Action::Go | Action::Slow, _) => DiagnosticStatus::WARN,
            (Action::Stop | Action::End, _) => DiagnosticStatus::ERROR,
        };
        let message = failsafe_in_words(&link);
        let values = vec![
            ("connected", (link.connected == 1).to_string()),
            ("at rest", (link.at_rest == 1).to_string()),
            ("tick latency, us", (link.latency_ns / 1000).to_string()),
            ("robot lost, times", link.losses.to_string()),
        ];
        let mut statuses = vec![self.status(level, "failsafe", message, values)];
        statuses.extend(self.state.stages.iter().map(|entry| self.stage(entry)));
        if let Some(power) = &self.state.power {
            let (level, message) = if power.is_low() {
                (DiagnosticStatus::WARN, "low")
            } else {
                (DiagnosticStatus::OK, "not low")
            };
            let volts = |volts: f64| format!("{volts:.2}");
            let values =
                vec![("board, V", volts(power.board_v)), ("motors, V", volts(power.motor_v))];
            statuses.push(self.status(level, "battery", message.to_owned(), values));
        }
        statuses
    }

    fn status(
        &self,
        level: u8,
        name: &str,
        message: String,
        values: Vec<(&str, String)>,
    ) -> DiagnosticStatus {
        let value = |(key, value): (&str, String)| KeyValue { key: key.to_owned(), value };
        DiagnosticStatus {
            level,
            name: format!("firsthand: {name}"),
            message,
            hardware_id: self.robot.clone(),
            values: values.into_iter().map(value).collect(),
        }
    }

    fn stage(&self, entry: &RosterEntry) -> DiagnosticStatus {
        let name = name_str(&entry.stage);
        let death = self
            .state
            .deaths
            .get(name)
            .map(|death| format!("generation {}: {}", death.generation, death_in_words(death)));
        let (level, state) = match entry.state() {
            StageState::Running => (DiagnosticStatus::OK, "runs"),
            StageState::Starting => (DiagnosticStatus::WARN, "starts"),
            StageState::Stopping => (DiagnosticStatus::WARN, "stops"),
            StageState::BackingOff => {
                (DiagnosticStatus::ERROR, "died often and waits for its restart")
            }
            StageState::Down => (DiagnosticStatus::ERROR, "is down"),
            StageState::Held => (DiagnosticStatus::ERROR, "died too often and is held"),
        };
        let values = vec![
            ("generation", entry.generation.to_string()),
            ("restarts", entry.restarts.to_string()),
            ("pid", entry.pid.to_string()),
            ("last death", death.unwrap_or_default()),
        ];
        self.status(level, name, state.to_owned(), values)
    }
}

/// Returns the parts of diagnostics whose change causes publication.
fn judged(statuses: &[DiagnosticStatus]) -> impl Iterator<Item = (u8, &str)> {
    statuses.iter().map(|status| (status.level, status.message.as_str()))
}

/// Returns a cell's occupancy: -1 unknown, 99 forbidden for the robot's centre, as in a Nav2
/// costmap.
fn occupancy(cell: u8) -> i8 {
    match CellState::from_byte(cell) {
        CellState::Free => -1,
        CellState::Scanned => 0,
        CellState::Margin => 99,
        CellState::Sensed | CellState::Known | CellState::Perimeter => 100,
    }
}

pub const fn plane(Pose2 { position, heading }: Pose2) -> Pose {
    [position.x, position.y, heading]
}

/// Follows the directions of `cells` from `from` to `to`, in steps of half a cell. Ends where there
/// is no direction.
fn way(frame: GridFrame, cells: &[FieldCell], from: DVec2, to: DVec2) -> Vec<Pose> {
    let step_m = frame.resolution_m / 2.0;
    let (mut at, mut way) = (from, Vec::new());
    for step in 0..frame.cells as usize * STEPS_A_CELL {
        let ahead = frame
            .cell_at(at)
            .and_then(|cell| cells.get(frame.index(cell)))
            .map_or(DVec2::ZERO, |cell| DVec2::new(cell.ex.into(), cell.ey.into()));
        if at.distance(to) <= frame.resolution_m || !ahead.is_finite() || ahead == DVec2::ZERO {
            break;
        }
        if step % POSE_EVERY == 0 {
            way.push([at.x, at.y, ahead.to_angle()]);
        }
        at += step_m * ahead;
    }
    let heading = way.last().map_or(0.0, |last| last[2]);
    way.push([at.x, at.y, heading]);
    way
}

fn mover((id, mover): (i32, &Mover)) -> [Marker; 3] {
    let at = mover.place();
    let disc = |namespace, radius_m: f64, alpha| {
        disc((namespace, id), [at.x, at.y, 0.0], 2.0 * radius_m, [0.8, 0.1, 0.1, alpha])
    };
    let way = lines(("in 1 s", id), &[at, at + mover.velocity()], 0.05, [0.8, 0.1, 0.1, 1.0]);
    [disc("movers", mover.radius_m.into(), 0.6), disc("doubt", mover.reach_m(), 0.2), way]
}

fn directions(frame: GridFrame, cells: &[FieldCell]) -> Marker {
    arrows([frame.cells as usize; 2], frame.resolution_m, |col, row| {
        let cell = Cell { col: col as u32, row: row as u32 };
        let direction = cells.get(frame.index(cell))?;
        let ahead = DVec2::new(direction.ex.into(), direction.ey.into());
        (ahead != DVec2::ZERO).then(|| [frame.centre_of(cell), ahead])
    })
}

/// Draws a line per group of cells along the direction that `of` returns.
pub fn arrows(
    [columns, rows]: [usize; 2],
    cell_m: f64,
    of: impl Fn(usize, usize) -> Option<[DVec2; 2]>,
) -> Marker {
    let each = columns.max(rows).div_ceil(ARROWS).max(1);
    let length = 0.7 * each as f64 * cell_m;
    let mut points = Vec::new();
    for row in (each / 2..rows).step_by(each) {
        for col in (each / 2..columns).step_by(each) {
            if let Some([at, ahead]) = of(col, row) {
                points.extend([at, at + length * ahead]);
            }
        }
    }
    lines(("field", 0), &points, 0.02, [0.2, 0.4, 0.9, 0.8])
}
