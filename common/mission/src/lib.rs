//! The mission file: everything that a run depends on, validated before anything starts.
//!
//! Metres, seconds, radians inside; degrees where a person writes them (`_deg`). All positions are in
//! the mission frame: its origin is where the robot starts and, unless `start.heading_deg` says
//! otherwise, its x-axis is the robot's own.

//!
//! | module | holds |
//! |---|---|
//! | `check` | reading it: syntax, keys, ranges |
//! | `robot`, `simulation` | its two largest parts |
//! | [`geometry`], [`grid`] | shapes; cells and metres, windows of cells |
//! | [`kinematics`] | equations (1)-(3) and their inverses |
//! | `odometry` | how the wheels differ from nominal ones, and the calibration file |
//! | `sensor`, [`sonar`] | the table of the ranging sensors, and how one is mounted, (19) |
//! | [`address`] | where a robot answers, and over which transport |
//! | `arduino`, `ros2` | the board of a robot with an Arduino; the topics of one that speaks ROS 2 |

pub mod address;
mod arduino;
mod check;
mod error;
pub mod geometry;
pub mod grid;
pub mod kinematics;
mod odometry;
mod robot;
mod ros2;
mod sensor;
mod simulation;
pub mod sonar;

use std::path::PathBuf;

use glam::DVec2;
use serde::{Deserialize, Serialize};

pub use arduino::{ArduinoBoard, LEAST_BAUD};
pub use error::MissionError;
pub use odometry::{Calibration, CalibrationPlan, Odometry, Procedure, Provenance};
pub use robot::{BatteryLimits, Body, Channel, Model, Protocol, RobotConfig, Steering};
pub use ros2::Ros2Topics;
pub use sensor::{
    INFRARED_RANGERS, MOST_BEAMS, MOST_SENSORS, SONARS, Sensor, SensorKind, SensorModel, SensorRow,
    Sensors, SonarConfig,
};
pub use simulation::{
    BatteryPhysics, Block, BlockedWheels, Heights, InfraredPhysics, Move, Physics, Radio, Ranger,
    Realism, Simulation, SonarPhysics, Thing, WheelPhysics,
};

use crate::{
    geometry::Shapes,
    grid::{GridFrame, MIN_CELLS},
    kinematics::Pose2,
};

/// A mission as it is written. Every key but `target` has a default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mission {
    /// The name of the mission; by default the file's name.
    #[serde(default)]
    pub name: String,
    /// One line for `firsthand missions`.
    #[serde(default)]
    pub description: String,
    /// X_T: where to go first, metres.
    #[serde(default = "defaults::no_target")]
    pub target: DVec2,
    /// The places to visit one after the other, in place of [`Mission::target`], which is then the first of them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub targets: Vec<Waypoint>,
    /// The method by which the robot is guided.
    #[serde(default)]
    pub method: Method,
    /// Whether readings of the sonar go into the map. Without them the robot knows only [`Mission::known`].
    #[serde(default = "defaults::sensing")]
    pub sensing: bool,
    /// The sensors whose readings go into the map; by default [`Mission::sensor_set`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensors: Option<Sensors>,
    /// The distance within which the target counts as reached, metres.
    #[serde(default = "defaults::arrival_tolerance_m")]
    pub arrival_tolerance_m: f64,
    /// An arrival is unsure if two standard deviations of the position's error exceed this along the worst axis, metres. A simulated
    /// robot that is farther off is in the wrong place.
    #[serde(default = "defaults::sure_within_m")]
    pub sure_within_m: f64,
    /// Mission time after which the mission is given up, seconds.
    #[serde(default = "defaults::timeout_s")]
    pub timeout_s: f64,
    /// Seed of everything random in the simulation.
    #[serde(default = "defaults::seed")]
    pub seed: u64,
    /// The robot's heading at the start.
    #[serde(default)]
    pub start: Start,
    /// Pi: where the robot may operate, and the grid laid over it.
    #[serde(default)]
    pub perimeter: Perimeter,
    /// The robot's body and where it answers.
    #[serde(default)]
    pub robot: RobotConfig,
    /// The front ultrasonic sensor of a robot without `[[robot.sensor]]`.
    #[serde(default)]
    pub sonar: SonarConfig,
    /// The values of dead reckoning, which turns wheel counts into the pose.
    #[serde(default)]
    pub dead_reckoning: DeadReckoning,
    /// The values of the mapper, which turns ranges into hazard cells.
    #[serde(default)]
    pub mapper: Mapper,
    /// The values of the planner, which turns hazard cells into guidance.
    #[serde(default)]
    pub planner: Planner,
    /// The values of the controller, which turns guidance into wheel speeds.
    #[serde(default)]
    pub controller: Controller,
    /// A map of the ROS map_server whose occupied cells become boxes of [`Mission::known`] before a run starts. A relative name is taken
    /// from the current directory.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<PathBuf>,
    /// The hazards that the map holds before the robot starts.
    #[serde(default, skip_serializing_if = "Shapes::is_empty")]
    pub known: Shapes,
    /// The shapes that really exist. Only the simulator reads them.
    #[serde(default, skip_serializing_if = "Shapes::is_empty")]
    pub world: Shapes,
    /// The behaviour of the simulated robot.
    #[serde(default)]
    pub simulation: Simulation,
    /// Remarks about a valid file, one line each: keys or values that have a new name now, and requests that the robot cannot fulfil.
    #[serde(skip)]
    pub remarks: Vec<String>,
}

/// The greatest number of targets in a list.
pub const MOST_TARGETS: usize = 16;

/// A place of a list of targets: `[x, y]`, or `[x, y, heading]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<f64>", into = "Vec<f64>")]
pub struct Waypoint {
    /// Metres.
    pub at: DVec2,
    /// The heading to turn to there, degrees counter-clockwise from x; none for any.
    pub heading_deg: Option<f64>,
}

impl TryFrom<Vec<f64>> for Waypoint {
    type Error = &'static str;

    fn try_from(numbers: Vec<f64>) -> Result<Self, Self::Error> {
        match numbers[..] {
            [x, y] => Ok(Self { at: DVec2::new(x, y), heading_deg: None }),
            [x, y, heading] => Ok(Self { at: DVec2::new(x, y), heading_deg: Some(heading) }),
            _ => Err("a target of a list is [x, y], or [x, y, heading in degrees]"),
        }
    }
}

impl From<Waypoint> for Vec<f64> {
    fn from(Waypoint { at, heading_deg }: Waypoint) -> Self {
        [at.x, at.y].into_iter().chain(heading_deg).collect()
    }
}

/// The method by which the robot is guided to its target.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// The robot looks before it drives: evidence for and against hazards, scanned ground, a speed that fits
    /// what is known of the way ahead.
    #[default]
    Evidential,
    /// The paper's method: every hit is a hazard with its margin, (19), the map only grows, (10), and the robot drives in the direction
    /// of the field, (15), (16).
    Paper,
}

/// The robot's heading at the start.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Start {
    /// Heading in the mission frame, degrees counter-clockwise from x.
    pub heading_deg: f64,
}

/// The square the robot may operate in, (18).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Perimeter {
    /// D: side of the square, metres.
    pub width_m: f64,
    /// N, the number of cells along each side. By default a cell has 0.05 m, a quarter of the X80's body, for a robot that looks first
    /// ([`Mission::looks_first`]), and 0.1 m for others: see [`Mission::grid_frame`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells: Option<u32>,
    /// Centre of the square, metres.
    pub centre: DVec2,
}

impl Perimeter {
    /// The most cells a side of a grid unless the mission says otherwise: the planner follows such a grid at the robot's rate with time to
    /// spare.
    const DEFAULT_MOST_CELLS: f64 = 512.0;
}

/// The values of dead reckoning, except those of the wheels, which are in [`Odometry`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DeadReckoning {
    /// The integration rule.
    pub integration: Integration,
}

/// The rule that integrates (20) into (21).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Integration {
    /// Exact along the arc of constant curvature.
    #[default]
    Arc,
    /// The paper's forward Euler, as (21) prints it.
    Euler,
}

/// The values of the mapper.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Mapper {
    /// The paper's method: how far around a hit cells are marked with it, metres:
    /// [`Mission::margin_cells`] is Im of (19).
    pub margin_m: f64,
    /// The evidential method: the distance left free between the body and a hit, metres.
    pub clearance_m: f64,
    /// Hits farther than this are no safety event yet, metres; by default [`Mission::map_within_m`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub map_within_m: Option<f64>,
}

/// The planner's executable, and the values of its field.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Planner {
    /// The evidential method: the time in which the robot must be able to stop before it meets what it believes in or has not scanned,
    /// seconds; by default that of [`Mission::hurry`]. The sonar's period, the radio's delay and the wheels' lag add up to 0.36 s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stops_within_s: Option<f64>,
    /// Screening length, metres: lambda of laplacian u = u / lambda^2. Without
    /// it the paper's method has no screening, which is exactly (11), and the evidential one takes
    /// [`Planner::EVIDENTIAL_SCREENING_M`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub screening_m: Option<f64>,
    /// The executable of the planner stage, in place of `firsthand`'s own; it is given the command line of
    /// `common::stage_command`. A run file has it absolute.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub executable: Option<PathBuf>,
    /// The values of the planner `calibration`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration: Option<CalibrationPlan>,
}

impl Planner {
    /// The screening length of the evidential method by default. It is so short that the field still leads to a gap that an echo narrows.
    pub const EVIDENTIAL_SCREENING_M: f64 = 0.35;
}

/// The values that decide how fast a robot of the evidential method may be, every one known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hurry {
    /// See [`Controller::full_speed_within_deg`].
    pub full_speed_within_deg: f64,
    /// See [`Controller::turns_beyond_deg`].
    pub turns_beyond_deg: f64,
    /// See [`Controller::look_rad_s`].
    pub look_rad_s: f64,
    /// See [`Planner::stops_within_s`].
    pub stops_within_s: f64,
}

/// The values of the controller, (14)-(17).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Controller {
    /// vd: the greatest tangential speed asked for, m/s; by default [`Mission::speed_m_s`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_m_s: Option<f64>,
    /// wd: the greatest turn rate asked for, rad/s; by default [`Mission::turn_rad_s`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turn_rad_s: Option<f64>,
    /// The evidential method drives at full speed while the robot faces its way within this angle, degrees; by default that of
    /// [`Mission::hurry`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub full_speed_within_deg: Option<f64>,
    /// The evidential method turns on the spot while the way lies farther than this to a side, degrees. At smaller angles the speed falls
    /// with the cosine. By default that of [`Mission::hurry`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turns_beyond_deg: Option<f64>,
    /// The greatest turn rate on the spot of the evidential method, rad/s; by default that of [`Mission::hurry`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub look_rad_s: Option<f64>,
    /// Rc: where slowing down before the target begins, metres.
    pub slow_radius_m: f64,
    /// |eta_c| below which an antipodal robot keeps its turning side.
    pub dead_zone: f64,
    /// Whether (16) modulates the speed by alignment; without it the speed is constant up to Rc.
    pub modulated: bool,
}

mod defaults {
    pub(super) const fn no_target() -> glam::DVec2 {
        glam::DVec2::NAN
    }
    pub(super) const fn arrival_tolerance_m() -> f64 {
        0.15
    }
    pub(super) const fn sure_within_m() -> f64 {
        0.5
    }
    pub(super) const fn sensing() -> bool {
        true
    }
    pub(super) const fn timeout_s() -> f64 {
        180.0
    }
    pub(super) const fn seed() -> u64 {
        1
    }
}

impl Default for Perimeter {
    fn default() -> Self {
        Self { width_m: 12.0, cells: None, centre: DVec2::ZERO }
    }
}

impl Default for Mapper {
    fn default() -> Self {
        Self { margin_m: 0.25, clearance_m: 0.03, map_within_m: None }
    }
}

impl Default for Controller {
    fn default() -> Self {
        Self {
            speed_m_s: None,
            turn_rad_s: None,
            full_speed_within_deg: None,
            turns_beyond_deg: None,
            look_rad_s: None,
            slow_radius_m: 0.4,
            dead_zone: 0.05,
            modulated: true,
        }
    }
}

impl Mission {
    /// The places to visit, one after the other.
    #[must_use]
    pub fn waypoints(&self) -> Vec<Waypoint> {
        match self.targets.is_empty() {
            true => vec![Waypoint { at: self.target, heading_deg: None }],
            false => self.targets.clone(),
        }
    }

    /// Delta = D / N and where the cells lie.
    #[must_use]
    pub fn grid_frame(&self) -> GridFrame {
        let Perimeter { width_m, centre, .. } = self.perimeter;
        let cells = self.perimeter.cells.unwrap_or_else(|| {
            let side_m = if self.looks_first() { 0.05 } else { 0.1 };
            let cells = (width_m / side_m).round();
            cells.clamp(f64::from(MIN_CELLS), Perimeter::DEFAULT_MOST_CELLS) as u32
        });
        GridFrame { cells, resolution_m: width_m / f64::from(cells), centre }
    }

    /// Im of (19): the least number of cells around a hit's own that covers the margin, however fine the
    /// grid is.
    #[must_use]
    pub fn margin_cells(&self) -> u32 {
        // The hit's own cell covers half a cell; a rounding error adds no cell.
        let cells = self.mapper.margin_m / self.grid_frame().resolution_m - 0.5;
        (cells - 1e-6).ceil().max(0.0) as u32
    }

    /// Whether the robot turns to look before it drives in a direction. It does so with the evidential method if it senses, can turn on
    /// the spot, and has no other planner. It can then stop within scanned ground, so its defaults are faster.
    #[must_use]
    pub fn looks_first(&self) -> bool {
        self.method == Method::Evidential
            && self.sensing
            && self.planner.executable.is_none()
            && self.body().ackermann().is_none()
    }

    /// vd, m/s: `controller.speed_m_s`, or by default 0.5 for a robot that looks first, 0.7 with infrared rangers, the body's top speed
    /// with a laser; else the paper's 0.25.
    #[must_use]
    pub fn speed_m_s(&self) -> f64 {
        self.controller.speed_m_s.unwrap_or_else(|| match self.looks_first() {
            false => 0.25,
            true if self.used(SensorKind::Scan) > 0 => self.body().top_speed_m_s,
            true if self.used(SensorKind::Ray) > 0 => 0.7,
            true => 0.5,
        })
    }

    /// The number of sensors of that kind that the mission uses.
    #[must_use]
    pub fn used(&self, kind: SensorKind) -> usize {
        self.sensor_table().iter().filter(|sensor| sensor.used && sensor.kind == kind).count()
    }

    /// The set of sensors that the mapper uses: `sensors`, or by default all that the robot has with the evidential method, and the front
    /// sonar alone with the paper's method or on a car.
    #[must_use]
    pub fn sensor_set(&self) -> Sensors {
        self.sensors.unwrap_or(match (self.method, self.robot.model) {
            (Method::Paper, _) | (_, Model::Car) => Sensors::Front,
            (Method::Evidential, _) => Sensors::All,
        })
    }

    /// The robot's ranging sensors. A reading names its sensor by the row of this table.
    #[must_use]
    pub fn sensor_table(&self) -> Vec<Sensor> {
        let RobotConfig { sensors, rate_hz, .. } = &self.robot;
        let rows = match self.robot.model {
            _ if !sensors.is_empty() => sensors.clone(),
            Model::X80 | Model::X80sv | Model::Car => {
                sensor::x80(self.body().radius_m, &self.sonar)
            }
            Model::Jackal => sensor::laser(SensorModel::Ust10lx, 0.12, 0.0),
            Model::TurtleBot3Burger => sensor::laser(SensorModel::Lds02, -0.032, 0.0),
            Model::TurtleBot3Waffle => sensor::laser(SensorModel::Lds02, -0.064, 0.0),
            Model::TurtleBot4 => sensor::laser(SensorModel::RplidarA1, -0.04, 90.0),
            Model::Kobuki | Model::Create3 => sensor::laser(SensorModel::RplidarA1, 0.0, 0.0),
        };
        sensor::table(&rows, *rate_hz, &self.sonar, self.sensor_set())
    }

    /// The row of the laser in [`Mission::sensor_table`], and the laser; none of a robot without one.
    #[must_use]
    pub fn laser(&self) -> Option<(usize, Sensor)> {
        let mut rows = self.sensor_table().into_iter().enumerate();
        rows.find(|(_, sensor)| sensor.kind == SensorKind::Scan)
    }

    /// The row of the front sonar in [`Mission::sensor_table`].
    #[must_use]
    pub fn front_row(&self) -> usize {
        sensor::front(&self.sensor_table(), &self.sonar).unwrap_or_default()
    }

    /// The front sonar.
    #[must_use]
    pub fn front_sonar(&self) -> Sensor {
        self.sensor_table().swap_remove(self.front_row())
    }

    /// The speeds of the evidential method, by its keys. A robot whose infrared rangers end at surfaces of any angle may hurry. One that
    /// has sonars alone turns at 1.2 rad/s, so that a cone of 15 degrees to either side covers each direction three times at 7 Hz: with
    /// 2.0 rad/s three times as many robots touched something, most of them the ends of loose walls.
    #[must_use]
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
            stops_within_s: self.planner.stops_within_s.unwrap_or(stops),
        }
    }

    /// wd, rad/s: `controller.turn_rad_s`, or by default 2.4 for a robot that looks first, else the paper's 0.8.
    #[must_use]
    pub fn turn_rad_s(&self) -> f64 {
        let default = if self.looks_first() { 2.4 } else { 0.8 };
        self.controller.turn_rad_s.unwrap_or(default)
    }

    /// Whether the link makes good that the wheels turn slower than commanded: `robot.speed_trim`, by default if the robot looks first.
    #[must_use]
    pub fn speed_trim(&self) -> bool {
        self.robot.speed_trim.unwrap_or_else(|| self.looks_first())
    }

    /// The greatest distance of mapped hits, metres: `mapper.map_within_m`, by default 0.6 for a robot that looks first and 1.0 for
    /// others. Farther out the arc of an echo is wider than the gaps that it would close.
    #[must_use]
    pub fn map_within_m(&self) -> f64 {
        let default = if self.looks_first() { 0.6 } else { 1.0 };
        self.mapper.map_within_m.unwrap_or(default)
    }

    /// The screening length of the field, metres: `planner.screening_m`, or by default that of the method; none for no screening, which is
    /// exactly (11).
    #[must_use]
    pub fn screening_length_m(&self) -> Option<f64> {
        let default = match self.method {
            // The length is at least what the grid resolves.
            Method::Evidential => {
                let resolution = self.grid_frame().resolution_m;
                Some(Planner::EVIDENTIAL_SCREENING_M.max(resolution / 2.0))
            }
            Method::Paper => None,
        };
        self.planner.screening_m.or(default)
    }

    /// The pose at mission time 0.
    #[must_use]
    pub fn start_pose(&self) -> Pose2 {
        Pose2 { position: DVec2::ZERO, heading: self.start.heading_deg.to_radians() }
    }

    /// The shapes of the world that the robot's body can touch. The others are above or below it.
    #[must_use]
    pub fn obstacles(&self) -> Shapes {
        self.simulation.physics().heights.touched(&self.world)
    }

    /// The body of the robot: its model with what the mission overrides.
    #[must_use]
    pub fn body(&self) -> Body {
        self.robot.body()
    }
}

#[cfg(test)]
mod tests;
