//! The mission file: everything that a run depends on, validated before anything starts.
//!
//! Metres, seconds, radians inside; degrees where a person writes them (`_deg`). All positions are in
//! the mission frame: unless `start` says otherwise, its origin is where the robot starts, and its x-axis
//! is the robot's own.
//!
//! | module | holds |
//! |---|---|
//! | `check` | reading: syntax, keys, ranges |
//! | `robot`, `simulation` | its two largest parts |
//! | [`geometry`], [`grid`] | shapes; cells |
//! | [`kinematics`] | (1)-(3) and their inverses |
//! | `odometry` | the wheels' errors, the calibration file |
//! | `sensor`, [`sonar`] | the table of ranging sensors; their mounting, (19) |
//! | [`address`] | a robot's address |
//! | `arduino`, `ros2` | the board of a robot with an Arduino; topics of ROS 2 |

/// Tables of the mission file: their keys, each with the default that it has if its type has no other. An unknown key is an error.
macro_rules! keys {
    (@) => { Default::default() };
    (@ $default:expr) => { $default };
    ($(#[$about:meta])* $name:ident { $($(#[$doc:meta])* $key:ident: $type:ty $(= $default:expr)?,)* }) => {
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct $name {
            $($(#[$doc])* pub $key: $type,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($key: keys!(@ $($default)?),)* }
            }
        }
    };
}

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
    INFRARED_RANGERS, MOST_BEAMS, MOST_LASERS, MOST_SENSORS, Rplidar, SONARS, Sensor, SensorKind,
    SensorModel, SensorRow, Sensors, SonarConfig,
};
pub use simulation::{
    BatteryPhysics, Block, BlockedWheels, Heights, Hole, InfraredPhysics, LaserTiming, Move,
    Person, Physics, Radio, Ranged, Ranger, Realism, Simulation, SonarPhysics, Thing, WheelPhysics,
};
pub use touch::{MOST_TOUCHES, TouchKind, TouchRow};

use crate::{
    geometry::{Shapes, Zone},
    grid::{GridFrame, MIN_CELLS},
    kinematics::Pose2,
};

keys! {
    /// Every key but `target` has a default, and a mission with `stay` needs none.
    Mission {
        /// The default is the file's name.
        name: String,
        /// One line for `firsthand missions`.
        description: String,
        /// X_T, metres.
        target: DVec2 = DVec2::NAN,
        /// The places to visit one after the other; [`Mission::target`] is then the first of them.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        targets: Vec<Waypoint>,
        method: Method,
        /// Readings of the sonar go into the map. Without them the robot knows only [`Mission::known`].
        sensing: bool = true,
        /// The rows that are mapped; by default [`Mission::sensor_set`].
        sensors: Option<Sensors>,
        /// Within this the target counts as reached.
        arrival_tolerance_m: f64 = 0.15,
        /// An arrival is unsure if two standard deviations of the position's error exceed this along the worst axis. A
        /// simulated robot that is farther off is in the wrong place.
        sure_within_m: f64 = 0.5,
        timeout_s: f64 = 180.0,
        /// The run goes on when a target is reached or given up: the robot stands and waits for the next one. Without a target it waits
        /// from its start on.
        stay: bool,
        /// Whether a service drives on by itself after it was cut off; see `firsthand run --resume-last`.
        resume: Resume,
        /// The seed of everything random in the simulation.
        seed: u64 = 1,
        start: Start,
        /// Pi: where the robot may operate, and the grid laid over it.
        perimeter: Perimeter,
        robot: RobotConfig,
        /// The front sonar of a robot without `[[robot.sensor]]`.
        sonar: SonarConfig,
        dead_reckoning: DeadReckoning,
        mapper: Mapper,
        planner: Planner,
        controller: Controller,
        /// A map of the ROS map_server whose occupied cells become boxes of [`Mission::known`]. A relative name is taken
        /// from the current directory.
        map: Option<PathBuf>,
        /// Hazards that the map holds before the robot starts.
        #[serde(skip_serializing_if = "Shapes::is_empty")]
        known: Shapes,
        /// Where the body may not go: hazards of the field, of which the simulator knows nothing.
        #[serde(rename = "zone", skip_serializing_if = "Vec::is_empty")]
        zones: Vec<Zone>,
        /// Shapes that really exist; only the simulator reads them.
        #[serde(skip_serializing_if = "Shapes::is_empty")]
        world: Shapes,
        simulation: Simulation,
        /// One line each on a valid file: keys or values with a new name, and requests that the robot cannot fulfil.
        #[serde(skip)]
        remarks: Vec<String>,
    }
}

pub const MOST_TARGETS: usize = 16;
pub const MOST_ZONES: usize = 16;
/// The most corners of a zone.
pub const MOST_CORNERS: usize = MOST_TARGETS;

/// `[x, y]`, or `[x, y, heading]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<f64>", into = "Vec<f64>")]
pub struct Waypoint {
    pub at: DVec2,
    /// The heading to turn to there, counter-clockwise from x; none for any.
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

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Looks before it drives: evidence for and against hazards, scanned ground, a speed that fits what is known of
    /// the way ahead.
    #[default]
    Evidential,
    /// Every hit is a hazard with its margin, (19), the map only grows, (10), and the robot drives in the direction
    /// of the field, (15), (16).
    Paper,
}

/// Written as a [`Waypoint`].
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

/// After a supervisor's death, a power cut or a reboot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Resume {
    /// The robot stands until an operator says resume.
    #[default]
    Manual,
    Automatic,
}

keys! {
    /// The square the robot may operate in, (18).
    Perimeter {
        /// D.
        width_m: f64 = 12.0,
        /// N along each side. By default a cell has 0.05 m, a quarter of the X80's body, for a robot that looks first
        /// ([`Mission::looks_first`]), else 0.1 m.
        cells: Option<u32>,
        /// Metres.
        centre: DVec2,
    }
}

impl Perimeter {
    /// Cells a side, unless the mission says otherwise: the planner follows such a grid at the robot's rate with time
    /// to spare.
    const DEFAULT_MOST_CELLS: f64 = 512.0;
}

keys! {
    /// All but the wheels' values, which are in [`Odometry`].
    DeadReckoning {
        integration: Integration,
    }
}

/// Integrates (20) into (21).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Integration {
    /// Exact along the arc of constant curvature.
    #[default]
    Arc,
    /// The paper's forward Euler, as (21) prints it.
    Euler,
}

keys! {
    Mapper {
        /// Paper: cells this far around a hit are marked with it; [`Mission::margin_cells`] is Im of (19).
        margin_m: f64 = 0.25,
        /// Evidential: left free between the body and a hit.
        clearance_m: f64 = 0.03,
        /// Hits farther than this are no safety event yet; by default [`Mission::map_within_m`].
        map_within_m: Option<f64>,
        /// Evidential: evidence falls evenly with time, and the strongest is gone after this; none for never.
        forget_after_s: Option<f64>,
    }
}

keys! {
    Planner {
        /// Evidential: the robot must be able to stop within this before it meets what it believes in or has not scanned;
        /// by default that of [`Mission::hurry`], which includes the base's dead time. A base that brakes slowly is given
        /// as much less speed as it needs: [`Response::speed_to_stop_within`].
        stops_within_s: Option<f64>,
        /// Lambda of laplacian u = u / lambda^2. Without it the paper's method has no screening, exactly (11), and the
        /// evidential one takes [`Planner::EVIDENTIAL_SCREENING_M`].
        screening_m: Option<f64>,
        /// A planner in place of `firsthand`'s own; it is given the command line of `common::stage_command`. A run file
        /// has it absolute.
        executable: Option<PathBuf>,
        calibration: Option<CalibrationPlan>,
    }
}

impl Planner {
    /// The length is so short that the field still leads to a gap that an echo narrows.
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
        /// wd; by default [`Mission::turn_rad_s`].
        turn_rad_s: Option<f64>,
        /// Evidential: at full speed while the robot faces its way within this angle; by default that of
        /// [`Mission::hurry`].
        full_speed_within_deg: Option<f64>,
        /// Evidential: turn on the spot while the way lies farther than this to a side; at smaller angles the speed falls
        /// with the cosine. By default that of [`Mission::hurry`].
        turns_beyond_deg: Option<f64>,
        /// Evidential: on the spot, at most; by default that of [`Mission::hurry`].
        look_rad_s: Option<f64>,
        /// Rc: slowing down begins this far from the target.
        slow_radius_m: f64 = 0.4,
        /// |eta_c| below which an antipodal robot keeps its turning side.
        dead_zone: f64 = 0.05,
        /// (16) modulates the speed by alignment; without it the speed is constant up to Rc.
        modulated: bool = true,
    }
}

impl Mission {
    pub fn waypoints(&self) -> Vec<Waypoint> {
        match self.targets.is_empty() {
            true => vec![Waypoint { at: self.target, heading_deg: None }],
            false => self.targets.clone(),
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

    /// Whether a place is inside the perimeter, and not on its rim.
    pub fn contains(&self, place: DVec2) -> bool {
        let frame = self.grid_frame();
        frame.cell_at(place).is_some_and(|cell| !frame.is_rim(cell))
    }

    /// Im of (19): the least number of cells around a hit's own that covers the margin.
    pub fn margin_cells(&self) -> u32 {
        // The hit's own cell covers half a cell, and a rounding error adds no cell.
        let cells = self.mapper.margin_m / self.grid_frame().resolution_m - 0.5;
        (cells - 1e-6).ceil().max(0.0) as u32
    }

    /// The robot turns to look before it drives in a direction: with the evidential method if it senses, can turn on
    /// the spot, and has no other planner. It can then stop within scanned ground, so its defaults are faster.
    pub fn looks_first(&self) -> bool {
        self.method == Method::Evidential
            && self.sensing
            && self.planner.executable.is_none()
            && self.body().ackermann().is_none()
    }

    /// The outline that the planner keeps clear where the circle that covers it does not fit: that of a robot with a laser that looks
    /// first. Others keep the circle clear.
    pub fn outline(&self) -> Option<Footprint> {
        let checks = self.looks_first() && self.used(SensorKind::Scan) > 0;
        self.body().footprint.filter(|_| checks)
    }

    /// vd: `controller.speed_m_s`, or by default 0.5 for a robot that looks first, 0.7 with infrared rangers, the
    /// body's top speed with a laser; else the paper's 0.25. Never more than [`Mission::sight_speed_m_s`].
    pub fn speed_m_s(&self) -> f64 {
        let asked = self.controller.speed_m_s.unwrap_or_else(|| match self.looks_first() {
            false => 0.25,
            true if self.used(SensorKind::Scan) > 0 => self.body().top_speed_m_s,
            true if self.used(SensorKind::Ray) > 0 => 0.7,
            true => 0.5,
        });
        asked.min(self.sight_speed_m_s())
    }

    /// The greatest speed from which the robot rests on ground that it has seen though all that looks ahead falls silent, m/s: ISO 3691-4
    /// wants the way to rest within the range of detection in the worst condition. Infinite where nothing looks ahead.
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

    /// `sensors`, or by default all of them with the evidential method, and the front sonar alone with the paper's
    /// method or on a car.
    pub fn sensor_set(&self) -> Sensors {
        self.sensors.unwrap_or(match (self.method, self.robot.model) {
            (Method::Paper, _) | (_, Model::Car) => Sensors::Front,
            (Method::Evidential, _) => Sensors::All,
        })
    }

    /// A reading names its sensor by the row of this table.
    pub fn sensor_table(&self) -> Vec<Sensor> {
        let RobotConfig { sensors, rate_hz, .. } = &self.robot;
        let rows = match &self.robot.preset().sensors {
            _ if !sensors.is_empty() => sensors.clone(),
            preset if !preset.is_empty() => preset.clone(),
            _ => sensor::x80(self.body().radius_m, &self.sonar),
        };
        sensor::table(&rows, *rate_hz, &self.sonar, self.sensor_set())
    }

    /// Bumpers and cliff sensors: those that are written, or else the model's. A robot says what they feel by their names.
    pub fn touches(&self) -> Vec<TouchRow> {
        match &self.robot.touches {
            written if !written.is_empty() => written.clone(),
            _ if self.robot.protocol().has_scans() => self.robot.preset().touches.clone(),
            _ => Vec::new(),
        }
    }

    /// The ROS topic of [`ros2::Ros2Topics::hazards`].
    pub fn hazards_topic(&self) -> Option<String> {
        let preset = &self.robot.preset().ros2;
        self.robot.ros2.hazards.as_ref().or(preset.hazards.as_ref()).cloned()
    }

    /// The lasers and their rows.
    pub fn lasers(&self) -> Vec<(usize, Sensor)> {
        let rows = self.sensor_table().into_iter().enumerate();
        rows.filter(|(_, sensor)| sensor.kind == SensorKind::Scan).collect()
    }

    /// The laser by whose scans the robot knows where it is: of those that the mission uses the first one with the widest view.
    pub fn laser(&self) -> Option<(usize, Sensor)> {
        self.lasers().into_iter().rev().max_by(|(_, a), (_, b)| {
            a.used.cmp(&b.used).then(a.field_of_view_deg.total_cmp(&b.field_of_view_deg))
        })
    }

    /// Those whose scans come with the robot's frames, and not on wires of their own.
    pub fn lasers_of_base(&self) -> Vec<(usize, Sensor)> {
        let mut lasers = self.lasers();
        lasers.retain(|(row, sensor)| self.rplidar(*row, sensor).is_none());
        lasers
    }

    /// The lasers with wires of their own.
    pub fn rplidars(&self) -> Vec<(usize, Sensor, Rplidar)> {
        let with_product = |(row, sensor)| {
            let product = self.rplidar(row, &sensor)?;
            Some((row, sensor, product))
        };
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

    /// A robot whose infrared rangers end at surfaces of any angle may hurry. One with sonars alone turns at 1.2
    /// rad/s, so that a cone of 15 degrees to either side covers each direction three times at 7 Hz: with 2.0 rad/s
    /// three times as many robots touched something, most of them the ends of loose walls.
    ///
    /// The times to stop were found with an X80, of whose dead time they include 0.15 s.
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

    /// The time until the robot brakes, seconds, from the pose for which the planner answers: the one at which the command acts, if the
    /// base answers late.
    pub fn brakes_within_s(&self) -> f64 {
        let within_s = self.hurry().stops_within_s;
        Lead::new(self).map_or(within_s, |lead| (within_s - lead.dead_time_s()).max(0.0))
    }

    /// wd: `controller.turn_rad_s`, or by default 2.4 for a robot that looks first, else the paper's 0.8.
    pub fn turn_rad_s(&self) -> f64 {
        let default = if self.looks_first() { 2.4 } else { 0.8 };
        self.controller.turn_rad_s.unwrap_or(default)
    }

    /// The link makes good that the wheels turn slower than commanded: `robot.speed_trim`, by default if the robot
    /// looks first.
    pub fn speed_trim(&self) -> bool {
        self.robot.speed_trim.unwrap_or_else(|| self.looks_first())
    }

    /// `mapper.map_within_m`, by default 0.6 for a robot that looks first and 1.0 for others. Farther out the arc of
    /// an echo is wider than the gaps that it would close.
    pub fn map_within_m(&self) -> f64 {
        let default = if self.looks_first() { 0.6 } else { 1.0 };
        self.mapper.map_within_m.unwrap_or(default)
    }

    /// `planner.screening_m`, or by default that of the method; none is exactly (11).
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

    pub fn start_pose(&self) -> Pose2 {
        Pose2 { position: self.start.at, heading: self.start.heading_deg.to_radians() }
    }

    /// From the start to the first target, metres.
    pub fn straight_m(&self) -> f64 {
        self.target.distance(self.start.at)
    }

    /// Shapes of the world that the body can touch; the others are above or below it.
    pub fn obstacles(&self) -> Shapes {
        self.simulation.physics().heights.touched(&self.world)
    }

    /// The wheels of the simulated base: as `simulation.wheels` says, or else as the robot's response.
    pub fn wheel_physics(&self) -> WheelPhysics {
        let (written, stated) = (&self.simulation.wheels, &self.robot.response);
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

    /// Whether the mission or its model states the base's response.
    pub fn states_response(&self) -> bool {
        let ResponseKeys { delay_s, acceleration_m_s2, .. } = self.robot.response;
        let is_written = delay_s.is_some() && acceleration_m_s2.is_some();
        let is_of_model = self.robot.preset().response.acceleration_m_s2.is_some();
        is_written || is_of_model || !self.robot.protocol().has_scans()
    }

    /// What the base is trusted to do: what is stated, and for the rest no more than a late and heavy base does. The link finds out
    /// what it really does.
    pub fn trusted_response(&self) -> Response {
        let Body { response, track_m, .. } = self.body();
        match self.states_response() {
            true => response,
            false => self.robot.response.over(Response::careful(track_m), track_m),
        }
    }

    /// The mission of a robot whose base was found to go on as before for `dead_time_s` and to accelerate at `acceleration_m_s2`, which
    /// may be infinite. None if no base does that.
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

    /// Whether planner and controller let the base's response limit the speed towards what they know.
    pub fn brakes_by_response(&self) -> bool {
        self.method == Method::Evidential && self.sensing && self.planner.executable.is_none()
    }
}

#[cfg(test)]
mod tests;
