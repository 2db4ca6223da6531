//! Mission file: every input of a run, validated before any process starts.
//!
//! Values are metres, seconds and radians; keys that people write in degrees end in `_deg`. All
//! positions are in the mission frame. By default its origin is the robot's start, and its x-axis
//! is the robot's axis there; `start` overrides both.
//!
//! | module | holds |
//! |---|---|
//! | `check` | parsing: syntax, keys, ranges |
//! | `robot`, `simulation` | the two largest tables |
//! | [`geometry`], [`grid`] | shapes; cells |
//! | [`kinematics`] | (1)-(3) and their inverses |
//! | `odometry` | wheel errors, the calibration file |
//! | `sensor`, [`sonar`] | the table of ranging sensors; their mounting, (19) |
//! | [`address`] | a robot's address |
//! | `arduino`, `ros2` | the Arduino board; ROS 2 topics |

#[macro_use]
mod macros;

pub mod address;
mod arduino;
mod check;
mod error;
mod footprint;
pub mod geometry;
pub mod grid;
pub mod kinematics;
mod lead;
mod odometry;
mod response;
mod robot;
mod ros2;
mod sensor;
mod simulation;
pub mod sonar;
#[cfg(test)]
mod testing;
mod touch;

use std::{f64::consts::FRAC_PI_4, path::PathBuf};

use glam::DVec2;
use serde::{Deserialize, Serialize};

pub use arduino::{ArduinoBoard, LEAST_BAUD};
pub use error::MissionError;
pub use footprint::Footprint;
pub use lead::Lead;
pub use odometry::{Calibration, CalibrationPlan, Odometry, Procedure, Provenance};
pub use response::{Base, ModelledSpeed, Response, ResponseKeys};
pub use robot::{BatteryLimits, Body, Channel, Model, Protocol, RobotConfig, Steering};
pub use ros2::Ros2Topics;
pub use sensor::{
    INFRARED_RANGERS, MOST_BEAMS, MOST_LASERS, MOST_SENSORS, Product, Rplidar, SONARS, Sensor,
    SensorKind, SensorModel, SensorRow, Sensors, SonarConfig,
};
pub use simulation::{
    BatteryPhysics, Block, BlockedWheels, Heights, Hole, InfraredPhysics, LaserTiming, Move,
    Person, Physics, Radio, Ranged, Ranger, Realism, Shove, Simulation, SonarPhysics, Thing,
    WheelPhysics, lasts,
};
pub use touch::{MOST_TOUCHES, TouchKind, TouchRow};

use crate::{
    geometry::{Shapes, Zone},
    grid::{GridFrame, MIN_CELLS},
    kinematics::Pose2,
};

keys! {
    /// Every key except `target` has a default; a mission with `stay` needs no key at all.
    Mission {
        name: String,
        description: String,
        /// X_T, metres.
        target: DVec2 = DVec2::NAN,
        #[serde(skip_serializing_if = "Vec::is_empty")]
        targets: Vec<Waypoint>,
        method: Method,
        sensing: bool = true,
        sensors: Option<Sensors>,
        /// Distance within which the target counts as reached.
        arrival_tolerance_m: f64 = 0.15,
        /// An arrival that may be farther off than this is unsure.
        sure_within_m: f64 = 0.5,
        timeout_s: f64 = 180.0,
        stay: bool,
        /// Whether a service resumes by itself; see `firsthand run --resume-last`.
        resume: Resume,
        seed: u64 = 1,
        start: Start,
        /// Pi: the permitted area and the grid over it.
        perimeter: Perimeter,
        robot: RobotConfig,
        /// Front sonar of a robot without `[[robot.sensor]]`.
        sonar: SonarConfig,
        dead_reckoning: DeadReckoning,
        mapper: Mapper,
        planner: Planner,
        controller: Controller,
        /// ROS `map_server` map whose occupied cells become boxes of [`Mission::known`]. Relative
        /// paths start at the current directory.
        map: Option<PathBuf>,
        /// Hazards in the map before the robot starts.
        #[serde(skip_serializing_if = "Shapes::is_empty")]
        known: Shapes,
        /// Keep-out zones: hazards of the field, unknown to the simulator.
        #[serde(rename = "zone", skip_serializing_if = "Vec::is_empty")]
        zones: Vec<Zone>,
        /// Real shapes; only the simulator reads them.
        #[serde(skip_serializing_if = "Shapes::is_empty")]
        world: Shapes,
        simulation: Simulation,
        /// Warnings about a valid file, one line each: renamed keys or values, impossible requests.
        #[serde(skip)]
        remarks: Vec<String>,
    }
}

/// Omits a table that a mission need not write.
fn is_default<T: Default + PartialEq>(table: &T) -> bool {
    *table == T::default()
}

pub const MOST_TARGETS: usize = 16;
pub const MOST_ZONES: usize = 16;
/// Upper limit of the corners in a zone.
pub const MOST_CORNERS: usize = MOST_TARGETS;

/// Target written as `[x, y]` or `[x, y, heading]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<f64>", into = "Vec<f64>")]
pub struct Waypoint {
    pub at: DVec2,
    /// Final heading, counter-clockwise from x; `None` accepts any.
    pub heading_deg: Option<f64>,
}

impl TryFrom<Vec<f64>> for Waypoint {
    type Error = &'static str;

    fn try_from(numbers: Vec<f64>) -> Result<Self, Self::Error> {
        match numbers[..] {
            [x, y] => Ok(Self { at: DVec2::new(x, y), heading_deg: None }),
            [x, y, heading] => Ok(Self { at: DVec2::new(x, y), heading_deg: Some(heading) }),
            _ => Err("a place is [x, y], or [x, y, heading in degrees]"),
        }
    }
}

impl From<Waypoint> for Vec<f64> {
    fn from(Waypoint { at, heading_deg }: Waypoint) -> Self {
        [at.x, at.y].into_iter().chain(heading_deg).collect()
    }
}

words! {
    #[derive(Default)]
    Method {
        /// Looks before it drives: evidence for and against hazards, scanned ground, and a speed
        /// that fits them.
        #[default]
        Evidential,
        /// Follows the paper. Each hit is a hazard with its margin (19), the map only grows (10),
        /// and the robot drives along the field (15), (16).
        Paper,
    }
}

/// Start pose, written as a [`Waypoint`] or as its heading alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "StartKeys", into = "Waypoint")]
pub struct Start {
    pub at: DVec2,
    /// Counter-clockwise from x of the mission frame.
    pub heading_deg: f64,
}

#[derive(Deserialize)]
#[serde(
    untagged,
    deny_unknown_fields,
    expecting = "start is [x, y], [x, y, heading in degrees] or { heading_deg = degrees }"
)]
enum StartKeys {
    Place(Waypoint),
    Heading { heading_deg: f64 },
}

impl From<StartKeys> for Start {
    fn from(keys: StartKeys) -> Self {
        match keys {
            StartKeys::Place(Waypoint { at, heading_deg }) => {
                Self { at, heading_deg: heading_deg.unwrap_or_default() }
            }
            StartKeys::Heading { heading_deg } => Self { at: DVec2::ZERO, heading_deg },
        }
    }
}

impl From<Start> for Waypoint {
    fn from(Start { at, heading_deg }: Start) -> Self {
        Self { at, heading_deg: Some(heading_deg) }
    }
}

words! {
    /// Behaviour after a supervisor crash, power failure or reboot.
    #[derive(Default)]
    Resume {
        /// Keeps the robot stopped until an operator resumes it.
        #[default]
        Manual,
        Automatic,
    }
}

keys! {
    /// Square that bounds the robot's operation (18).
    Perimeter {
        /// D.
        width_m: f64 = 12.0,
        /// N along each side. By default a cell has 0.05 m, a quarter of the X80's body, if
        /// [`Mission::looks_first`], else 0.1 m.
        cells: Option<u32>,
        centre: DVec2,
    }
}

impl Perimeter {
    /// Default limit of N, which the planner solves at the robot's rate with time to spare.
    const DEFAULT_MOST_CELLS: f64 = 512.0;
}

keys! {
    DeadReckoning {
        integration: Integration,
    }
}

words! {
    #[derive(Default)]
    Integration {
        /// Exact along the arc of constant curvature.
        #[default]
        Arc,
        /// Forward Euler, as the paper prints (21).
        Euler,
    }
}

keys! {
    Mapper {
        /// Paper: radius marked around a hit; [`Mission::margin_cells`] is Im of (19).
        margin_m: f64 = 0.25,
        clearance_m: f64 = 0.03,
        map_within_m: Option<f64>,
        forget_after_s: Option<f64>,
    }
}

keys! {
    Planner {
        /// Includes the base's dead time. Bases that brake slowly get a lower speed:
        /// [`Response::speed_to_stop_within`].
        stops_within_s: Option<f64>,
        /// Lambda of laplacian u = u / lambda^2.
        screening_m: Option<f64>,
        /// Planner in place of `firsthand`'s own, with the command line of `common::stage_command`;
        /// absolute in a run file.
        executable: Option<PathBuf>,
        calibration: Option<CalibrationPlan>,
    }
}

impl Planner {
    /// Short enough for the field to lead to a gap that an echo narrows.
    pub const EVIDENTIAL_SCREENING_M: f64 = 0.35;
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hurry {
    pub full_speed_within_deg: f64,
    pub turns_beyond_deg: f64,
    pub look_rad_s: f64,
    pub stops_within_s: f64,
}

keys! {
    /// Equations (14)-(17).
    Controller {
        /// vd; by default [`Mission::speed_m_s`].
        speed_m_s: Option<f64>,
        /// wd.
        turn_rad_s: Option<f64>,
        full_speed_within_deg: Option<f64>,
        turns_beyond_deg: Option<f64>,
        look_rad_s: Option<f64>,
        /// Rc.
        slow_radius_m: f64 = 0.4,
        /// Of |eta_c|.
        dead_zone: f64 = 0.05,
        modulated: bool = true,
    }
}

impl Mission {
    pub fn waypoints(&self) -> Vec<Waypoint> {
        if self.targets.is_empty() {
            vec![Waypoint { at: self.target, heading_deg: None }]
        } else {
            self.targets.clone()
        }
    }

    pub fn grid_frame(&self) -> GridFrame {
        let Perimeter { width_m, centre, .. } = self.perimeter;
        let cells = self.perimeter.cells.unwrap_or_else(|| {
            let side_m = if self.looks_first() { 0.05 } else { 0.1 };
            let cells = (width_m / side_m).round();
            cells.clamp(f64::from(MIN_CELLS), Perimeter::DEFAULT_MOST_CELLS) as u32
        });
        GridFrame { cells, resolution_m: width_m / f64::from(cells), centre }
    }

    /// Returns whether a place is inside the perimeter, off its rim.
    pub fn contains(&self, place: DVec2) -> bool {
        let frame = self.grid_frame();
        frame.cell_at(place).is_some_and(|cell| !frame.is_rim(cell))
    }

    /// Returns Im of (19): the fewest cells around the hit cell that cover the margin.
    pub fn margin_cells(&self) -> u32 {
        // The hit cell covers half a cell itself; rounding must not add one.
        let cells = self.mapper.margin_m / self.grid_frame().resolution_m - 0.5;
        (cells - 1e-6).ceil().max(0.0) as u32
    }

    /// Returns whether the robot looks in a direction before it drives there.
    ///
    /// This needs the evidential method with sensing and the built-in planner, and a robot that
    /// turns on the spot. It can stop within scanned ground, so its defaults are faster.
    pub fn looks_first(&self) -> bool {
        self.brakes_by_response() && self.body().ackermann().is_none()
    }

    /// Returns the outline to keep clear where the covering circle does not fit. Only robots with a
    /// laser that look first have one.
    pub fn outline(&self) -> Option<Footprint> {
        self.body().footprint.filter(|_| self.looks_first() && self.used(SensorKind::Scan) > 0)
    }

    /// Returns vd: `controller.speed_m_s`, capped at [`Mission::sight_speed_m_s`].
    ///
    /// By default it is the paper's 0.25. For a robot that looks first it is the body's top speed
    /// with a laser, 0.7 with infrared rangers, else 0.5.
    pub fn speed_m_s(&self) -> f64 {
        let asked = self.controller.speed_m_s.unwrap_or_else(|| match self.looks_first() {
            false => 0.25,
            true if self.used(SensorKind::Scan) > 0 => self.body().top_speed_m_s,
            true if self.used(SensorKind::Ray) > 0 => 0.7,
            true => 0.5,
        });
        asked.min(self.sight_speed_m_s())
    }

    /// Returns the greatest speed, m/s, that lets the robot stop on seen ground after all
    /// forward-looking sensors fall silent; infinite without one.
    ///
    /// ISO 3691-4 requires the stopping distance to fit the detection range in the worst condition.
    pub fn sight_speed_m_s(&self) -> f64 {
        let response = self.trusted_response();
        let after_s = self.robot.silent_after_s() + response.dead_time_s();
        let looks_ahead = |sensor: &Sensor| {
            let is_wide = sensor.kind == SensorKind::Scan;
            sensor.used && (is_wide || sensor.mount.bearing_rad.abs() <= FRAC_PI_4)
        };
        let table = self.sensor_table();
        let reach_m = table.iter().filter(|sensor| looks_ahead(sensor)).map(|it| it.reach_m);
        reach_m.reduce(f64::max).map_or(f64::INFINITY, |reach_m| {
            response.speed_to_stop_within((reach_m - self.body().radius_m).max(0.0), after_s)
        })
    }

    pub fn used(&self, kind: SensorKind) -> usize {
        self.sensor_table().iter().filter(|sensor| sensor.used && sensor.kind == kind).count()
    }

    /// Returns `sensors`. By default it is all with the evidential method, and the front sonar with
    /// the paper's method or on a car.
    pub fn sensor_set(&self) -> Sensors {
        self.sensors.unwrap_or(match (self.method, self.robot.model) {
            (Method::Paper, _) | (_, Model::Car) => Sensors::Front,
            (Method::Evidential, _) => Sensors::All,
        })
    }

    /// A reading names its sensor by its row here.
    pub fn sensor_table(&self) -> Vec<Sensor> {
        let RobotConfig { sensors, rate_hz, .. } = &self.robot;
        let rows = match &self.robot.preset().sensors {
            _ if !sensors.is_empty() => sensors.clone(),
            preset if !preset.is_empty() => preset.clone(),
            _ => sensor::x80(self.body().radius_m, &self.sonar),
        };
        sensor::table(&rows, *rate_hz, &self.sonar, self.sensor_set())
    }

    /// Returns the written bumpers and cliff sensors, or the model's. The robot reports them by
    /// name.
    pub fn touches(&self) -> Vec<TouchRow> {
        match &self.robot.touches {
            written if !written.is_empty() => written.clone(),
            _ if self.robot.protocol().has_scans() => self.robot.preset().touches.clone(),
            _ => Vec::new(),
        }
    }

    pub fn hazards_topic(&self) -> Option<String> {
        self.robot.ros2.hazards.clone().or_else(|| self.robot.preset().ros2.hazards.clone())
    }

    pub fn lasers(&self) -> Vec<(usize, Sensor)> {
        let rows = self.sensor_table().into_iter().enumerate();
        rows.filter(|(_, sensor)| sensor.kind == SensorKind::Scan).collect()
    }

    /// Of the used lasers, the first with the widest view; for localisation.
    pub fn laser(&self) -> Option<(usize, Sensor)> {
        self.lasers().into_iter().rev().max_by(|(_, a), (_, b)| {
            a.used.cmp(&b.used).then(a.field_of_view_deg.total_cmp(&b.field_of_view_deg))
        })
    }

    /// Returns the lasers whose scans arrive with the robot's frames.
    pub fn lasers_of_base(&self) -> Vec<(usize, Sensor)> {
        let mut lasers = self.lasers();
        lasers.retain(|(row, sensor)| self.rplidar(*row, sensor).is_none());
        lasers
    }

    /// Returns the lasers with a wire of their own.
    pub fn rplidars(&self) -> Vec<(usize, Sensor, Rplidar)> {
        let with_product =
            |(row, sensor)| self.rplidar(row, &sensor).map(|product| (row, sensor, product));
        self.lasers().into_iter().filter_map(with_product).collect()
    }

    fn rplidar(&self, row: usize, sensor: &Sensor) -> Option<Rplidar> {
        let written = self.robot.sensors.get(row)?;
        let has_wire = written.address.is_some() || !self.robot.protocol().has_scans();
        sensor.model.rplidar().filter(|_| has_wire)
    }

    pub fn front_row(&self) -> usize {
        sensor::front(&self.sensor_table(), &self.sonar).unwrap_or_default()
    }

    pub fn front_sonar(&self) -> Sensor {
        self.sensor_table().swap_remove(self.front_row())
    }

    /// Returns the speed limits that suit the robot's sensors.
    ///
    /// Infrared rangers and lasers measure surfaces at any angle, so such a robot may be fast. With
    /// sonars alone it turns at 1.2 rad/s: a cone of 15 degrees to either side then covers each
    /// direction three times at 7 Hz. At 2.0 rad/s three times as many robots touched something,
    /// mostly the ends of loose walls.
    ///
    /// The stopping times were found with an X80 and include 0.15 s of its dead time.
    pub fn hurry(&self) -> Hurry {
        let uses = |kind| self.looks_first() && self.used(kind) > 0;
        let sees = uses(SensorKind::Ray) || uses(SensorKind::Scan);
        let [full, turns, look, stops] =
            if sees { [26.0, 73.0, 2.0, 0.4] } else { [1.0, 45.0, 1.2, 0.6] };
        let Controller { full_speed_within_deg, turns_beyond_deg, look_rad_s, .. } =
            self.controller;
        Hurry {
            full_speed_within_deg: full_speed_within_deg.unwrap_or(full),
            turns_beyond_deg: turns_beyond_deg.unwrap_or(turns),
            look_rad_s: look_rad_s.unwrap_or(look),
            stops_within_s: self.planner.stops_within_s.unwrap_or_else(|| {
                stops + (self.trusted_response().dead_time_s() - Response::X80.dead_time_s())
            }),
        }
    }

    /// Returns the time until the robot brakes, seconds, from the pose for which the planner
    /// answers. On a late base that is where the command acts.
    pub fn brakes_within_s(&self) -> f64 {
        let within_s = self.hurry().stops_within_s;
        Lead::new(self).map_or(within_s, |lead| (within_s - lead.dead_time_s).max(0.0))
    }

    /// By default 2.4 for a robot that looks first, else the paper's 0.8.
    pub fn turn_rad_s(&self) -> f64 {
        let default = if self.looks_first() { 2.4 } else { 0.8 };
        self.controller.turn_rad_s.unwrap_or(default)
    }

    /// Returns whether the link compensates wheels that turn slower than commanded:
    /// `robot.speed_trim`, by default for a robot that looks first.
    pub fn speed_trim(&self) -> bool {
        self.robot.speed_trim.unwrap_or_else(|| self.looks_first())
    }

    /// Returns `mapper.map_within_m`, by default 0.6 for a robot that looks first, else 1.0.
    /// Farther out the arc of an echo is wider than the gaps that it would close.
    pub fn map_within_m(&self) -> f64 {
        let default = if self.looks_first() { 0.6 } else { 1.0 };
        self.mapper.map_within_m.unwrap_or(default)
    }

    /// `None` is exactly (11).
    pub fn screening_length_m(&self) -> Option<f64> {
        let default = match self.method {
            // The grid limits the resolvable length.
            Method::Evidential => {
                let resolution = self.grid_frame().resolution_m;
                Some(Planner::EVIDENTIAL_SCREENING_M.max(resolution / 2.0))
            }
            Method::Paper => None,
        };
        self.planner.screening_m.or(default)
    }

    pub fn start_pose(&self) -> Pose2 {
        Pose2 { position: self.start.at, heading: self.start.heading_deg.to_radians() }
    }

    pub fn straight_m(&self) -> f64 {
        self.target.distance(self.start.at)
    }

    /// At the body's height.
    pub fn obstacles(&self) -> Shapes {
        self.simulation.physics().heights.touched(&self.world)
    }

    pub fn wheel_physics(&self) -> WheelPhysics {
        let written = &self.simulation.wheels;
        let stated = &self.robot.response;
        let preset = self.simulation.physics().wheels;
        let response = self.body().response;
        WheelPhysics {
            acceleration_m_s2: written.acceleration_m_s2.unwrap_or(response.acceleration_m_s2),
            delay_s: written.delay_s.or(stated.delay_s).unwrap_or(preset.delay_s),
            lag_s: written.lag_s.or(stated.lag_s).unwrap_or(preset.lag_s),
            ..preset
        }
    }

    pub fn body(&self) -> Body {
        self.robot.body()
    }

    /// Returns whether the mission or its model states the base's response.
    pub fn states_response(&self) -> bool {
        let ResponseKeys { delay_s, acceleration_m_s2, .. } = self.robot.response;
        let is_written = delay_s.is_some() && acceleration_m_s2.is_some();
        let is_of_model = self.robot.preset().response.acceleration_m_s2.is_some();
        is_written || is_of_model || !self.robot.protocol().has_scans()
    }

    /// Returns the response that planning may rely on. Unstated values are those of a late and
    /// heavy base until the link identifies them.
    pub fn trusted_response(&self) -> Response {
        let Body { response, track_m, .. } = self.body();
        if self.states_response() {
            response
        } else {
            self.robot.response.over(Response::careful(track_m), track_m)
        }
    }

    /// Returns the mission with an identified response. `acceleration_m_s2` may be infinite;
    /// implausible values give `None`.
    pub fn with_response(&self, dead_time_s: f64, acceleration_m_s2: f64) -> Option<Self> {
        let is_a_base = (0.0..=4.0).contains(&dead_time_s) && acceleration_m_s2 >= 0.05;
        is_a_base.then(|| {
            let body = self.body();
            let turn = 2.0 * acceleration_m_s2 / body.track_m;
            let mut mission = self.clone();
            mission.robot.response = ResponseKeys {
                delay_s: Some(dead_time_s),
                lag_s: Some(0.0),
                acceleration_m_s2: Some(acceleration_m_s2),
                turn_acceleration_rad_s2: Some(body.response.turn_acceleration_rad_s2.min(turn)),
            };
            mission
        })
    }

    /// Returns whether the robot tests its wheels, slowly and for a minute, and so drives on if they
    /// do not follow their commands.
    pub fn tests_wheels(&self) -> bool {
        let plan = self.planner.calibration.as_ref();
        plan.is_some_and(|plan| plan.procedure == Procedure::BringUp)
    }

    /// Returns whether planner and controller limit the speed by the base's response.
    pub fn brakes_by_response(&self) -> bool {
        self.method == Method::Evidential && self.sensing && self.planner.executable.is_none()
    }
}

#[cfg(test)]
mod tests;
