//! Reading a mission file: syntax, unknown keys, and every number's range, each error with line and key.

mod arduino;
mod calibration;
mod objection;
mod robot;
mod ros2;
mod sensor;
mod shapes;
mod simulation;

use std::{
    fs::{self, File},
    io::{self, Read as _},
    path::{Path, PathBuf},
};

use glam::DVec2;
use toml::de::{DeTable, DeValue};

use self::objection::{Objection, objection, within};
use super::{MOST_TARGETS, Method, Mission, Sensors, Waypoint, error::MissionError};
use crate::grid::{MAX_CELLS, MIN_CELLS};

/// A mission is a page or two; a file without end is no mission.
const MAX_BYTES: u64 = 8 << 20;

fn read_bounded(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    // Opening a pipe would wait for its writer.
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::other("it is no regular file"));
    }
    let read = File::open(path)?.take(MAX_BYTES).read_to_string(&mut text)?;
    if read as u64 == MAX_BYTES {
        return Err(io::Error::other(format!("it is {MAX_BYTES} bytes or more")));
    }
    Ok(text)
}

const MAX_TIMEOUT_S: f64 = 86_400.0;

impl Mission {
    /// # Errors
    /// The line, the key, what is wrong and the remedy; `origin` names the file.
    pub fn parse(text: &str, origin: &Path) -> Result<Self, MissionError> {
        parse(text, origin)
    }

    /// # Errors
    /// As [`Mission::parse`], and when the file cannot be read.
    pub fn load(path: &Path) -> Result<Self, MissionError> {
        Self::parse(&Self::read(path)?, path)
    }

    /// # Errors
    /// When the file cannot be read, or is far too long for a mission.
    pub fn read(path: &Path) -> Result<String, MissionError> {
        read_bounded(path)
            .map_err(|source| MissionError::Unreadable { file: PathBuf::from(path), source })
    }
}

fn parse(text: &str, origin: &Path) -> Result<Mission, MissionError> {
    let syntax = |error: &toml::de::Error| MissionError::Syntax {
        file: origin.to_path_buf(),
        line: error.span().map_or(1, |span| line_of(text, span.start)),
        problem: error.message().trim().replace('\n', " "),
    };
    let tree = DeTable::parse(text).map_err(|error| syntax(&error))?;
    let mut mission: Mission = toml::from_str(text).map_err(|error| syntax(&error))?;
    let has_target = tree.get_ref().contains_key("target");
    if !has_target && let Some(first) = mission.targets.first() {
        mission.target = first.at;
    } else if !has_target {
        return Err(MissionError::Syntax {
            file: origin.to_path_buf(),
            line: 1,
            problem: "missing field `target`".to_owned(),
        });
    }
    if mission.name.is_empty() {
        mission.name =
            origin.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    }
    mission.remarks = remarks(text, origin, tree.get_ref(), &mission);
    match Checker::default().run(&mission) {
        Ok(()) => Ok(mission),
        Err(Objection { key, problem, remedy }) => Err(MissionError::Value {
            file: origin.to_path_buf(),
            line: line_of(text, span_of(tree.get_ref(), key)),
            key: key.to_owned(),
            problem,
            remedy,
        }),
    }
}

fn remarks(text: &str, origin: &Path, tree: &DeTable<'_>, mission: &Mission) -> Vec<String> {
    let file = origin.display();
    let line = |key| line_of(text, span_of(tree, key));
    let looks = mission.method == Method::Evidential && mission.sensing;
    let car = mission.body().ackermann().filter(|_| looks).map(|car| {
        let (line, radius) = (line("robot.model"), car.least_turning_radius());
        format!(
            "{file}:{line}: robot.model: a car turns in no less than {radius:.2} m, so it does not turn on the spot to look before it drives"
        )
    });
    let robot = tree.get("robot").and_then(|value| value.get_ref().as_table());
    let twice =
        robot.filter(|robot| mission.robot.calibration.is_some() && robot.contains_key("odometry"));
    let twice = twice.map(|_| {
        let line = line("robot.calibration");
        format!("{file}:{line}: robot.calibration: its values replace those of robot.odometry; remove one of them")
    });
    car.into_iter().chain(twice).collect()
}

/// Lines count from 1.
fn line_of(text: &str, offset: usize) -> usize {
    let upto = &text.as_bytes()[..offset.min(text.len())];
    1 + upto.iter().filter(|&&byte| byte == b'\n').count()
}

/// Byte offset of the deepest part of dotted `key` that the file has; a default has no line of its own.
fn span_of(tree: &DeTable<'_>, key: &str) -> usize {
    let mut table = tree;
    let mut start = 0;
    for part in key.split('.') {
        let Some((name, value)) = table.get_key_value(part) else {
            break;
        };
        start = name.span().start;
        match value.get_ref() {
            DeValue::Table(inner) => table = inner,
            _ => break,
        }
    }
    start
}

#[derive(Default)]
struct Checker {
    points: usize,
}

impl Checker {
    fn run(&mut self, mission: &Mission) -> Result<(), Objection> {
        let plain = |c: char| c.is_alphanumeric() || "-_. ".contains(c);
        if mission.name.starts_with('.') || !mission.name.chars().all(plain) {
            return Err(objection(
                "name",
                format!("{:?} would not do as the name of a directory", mission.name),
                "use letters, digits, '-' and '_'",
            ));
        }
        if mission.method == Method::Paper && mission.sensor_set() != Sensors::Front {
            return Err(objection(
                "sensors",
                "the paper's method has the front sonar alone",
                "give \"front\", or method = \"evidential\"",
            ));
        }
        self.perimeter(mission)?;
        self.target(mission)?;
        within("timeout_s", mission.timeout_s, 1.0..=MAX_TIMEOUT_S, "s")?;
        within("start.heading_deg", mission.start.heading_deg, -360.0..=360.0, "degrees")?;
        robot::check(mission)?;
        sensor::check(mission)?;
        ros2::check(mission)?;
        arduino::check(mission)?;
        stages(mission)?;
        self.shapes("known", &mission.known)?;
        self.shapes("world", &mission.world)?;
        self.simulation(&mission.simulation)?;
        start_is_free(mission)
    }

    fn perimeter(&mut self, mission: &Mission) -> Result<(), Objection> {
        let perimeter = &mission.perimeter;
        within("perimeter.width_m", perimeter.width_m, 0.5..=1000.0, "m")?;
        let cells = mission.grid_frame().cells;
        if !(MIN_CELLS..=MAX_CELLS).contains(&cells) {
            return Err(objection(
                "perimeter.cells",
                format!("a grid of {cells} x {cells} cells cannot be"),
                format!("give {MIN_CELLS} to {MAX_CELLS}"),
            ));
        }
        self.point("perimeter.centre", perimeter.centre)?;
        let frame = mission.grid_frame();
        if frame.cell_at(DVec2::ZERO).is_none_or(|cell| frame.is_rim(cell)) {
            return Err(objection(
                "perimeter.centre",
                "the robot's start (0, 0) is not inside the perimeter",
                "move the centre or widen perimeter.width_m",
            ));
        }
        Ok(())
    }

    fn target(&mut self, mission: &Mission) -> Result<(), Objection> {
        let key = key_of_target(mission);
        let frame = mission.grid_frame();
        for Waypoint { at, heading_deg } in mission.waypoints() {
            self.point(key, at)?;
            if frame.cell_at(at).is_none_or(|cell| frame.is_rim(cell)) {
                return Err(objection(
                    key,
                    format!(
                        "{at} is not inside the perimeter of {} m around {}",
                        mission.perimeter.width_m, mission.perimeter.centre
                    ),
                    "move the target in, or widen perimeter.width_m",
                ));
            }
            within(key, heading_deg.unwrap_or_default(), -360.0..=360.0, "degrees of heading")?;
            if heading_deg.is_some() && mission.body().steering.is_some() {
                return Err(objection(
                    key,
                    "a car does not turn on the spot, so its targets have no heading",
                    "give [x, y]",
                ));
            }
        }
        if mission.targets.len() > MOST_TARGETS {
            return Err(objection(
                key,
                format!("a list of {} targets is too long", mission.targets.len()),
                format!("give 1 to {MOST_TARGETS}"),
            ));
        }
        // A run file has both keys.
        if mission.targets.first().is_some_and(|first| first.at != mission.target) {
            return Err(objection(
                "targets",
                "target and targets are both given",
                "leave one of them out",
            ));
        }
        let half = mission.perimeter.width_m / 2.0;
        within("arrival_tolerance_m", mission.arrival_tolerance_m, 0.01..=half, "m")?;
        within("sure_within_m", mission.sure_within_m, 0.01..=100.0, "m")
    }

    fn point(&mut self, key: &'static str, point: DVec2) -> Result<(), Objection> {
        if point.is_finite() {
            return Ok(());
        }
        Err(objection(key, format!("{point} is not a place"), "give two finite numbers, metres"))
    }
}

const fn key_of_target(mission: &Mission) -> &'static str {
    if mission.targets.is_empty() { "target" } else { "targets" }
}

fn stages(mission: &Mission) -> Result<(), Objection> {
    let controller = &mission.controller;
    let top = mission.body().top_speed_m_s;
    within("controller.speed_m_s", mission.speed_m_s(), 0.001..=top, "m/s")?;
    within("controller.turn_rad_s", mission.turn_rad_s(), 0.01..=20.0, "rad/s")?;
    within("controller.look_rad_s", mission.hurry().look_rad_s, 0.01..=20.0, "rad/s")?;
    let hurry = mission.hurry();
    within("controller.turns_beyond_deg", hurry.turns_beyond_deg, 2.0..=90.0, "degrees")?;
    let most = hurry.turns_beyond_deg - 1.0;
    within("controller.full_speed_within_deg", hurry.full_speed_within_deg, 0.0..=most, "degrees")?;
    within("planner.stops_within_s", hurry.stops_within_s, 0.05..=10.0, "s")?;
    within("controller.slow_radius_m", controller.slow_radius_m, 0.001..=1000.0, "m")?;
    within("controller.dead_zone", controller.dead_zone, 0.0..=0.9, "")?;
    within("mapper.map_within_m", mission.map_within_m(), 0.04..=2.54, "m")?;
    let perimeter = &mission.perimeter;
    within("mapper.margin_m", mission.mapper.margin_m, 0.0..=perimeter.width_m / 4.0, "m")?;
    within("mapper.clearance_m", mission.mapper.clearance_m, 0.0..=1.0, "m")?;
    if let Some(executable) = &mission.planner.executable
        && executable.as_os_str().is_empty()
    {
        return Err(objection(
            "planner.executable",
            "it is empty",
            "name an executable, or leave the key out",
        ));
    }
    if let Some(plan) = &mission.planner.calibration {
        within("planner.calibration.ratio_sd", plan.ratio_sd, 0.0..=0.1, "")?;
        within("planner.calibration.loops", f64::from(plan.loops), 6.0..=64.0, "loops")?;
        within("planner.calibration.drive_m", plan.drive_m, 0.6..=10.0, "m")?;
    }
    if let Some(screening) = mission.planner.screening_m {
        // The grid does not resolve a shorter length.
        let least = mission.grid_frame().resolution_m / 2.0;
        within("planner.screening_m", screening, least..=1e6, "m")?;
    }
    Ok(())
}

/// A robot that starts inside a hazard has already collided.
fn start_is_free(mission: &Mission) -> Result<(), Objection> {
    let radius = mission.body().radius_m;
    for (key, shapes) in [("world", &mission.obstacles()), ("known", &mission.known)] {
        let clearance = shapes.clearance(DVec2::ZERO);
        if clearance <= radius {
            return Err(objection(
                key,
                format!(
                    "something stands {clearance:.2} m from the start, and the robot's radius is {radius} m"
                ),
                "move it away from (0, 0)",
            ));
        }
        for Waypoint { at, .. } in mission.waypoints() {
            if shapes.clearance(at) <= 0.0 {
                let problem = match mission.targets.is_empty() {
                    true => "the target lies inside a shape".to_owned(),
                    false => format!("the target {at} lies inside a shape"),
                };
                return Err(objection(key, problem, "move one of them"));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
