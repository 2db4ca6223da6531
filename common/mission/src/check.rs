//! Mission file validation: syntax, unknown keys and ranges, each error with line and key.

mod arduino;
mod calibration;
mod objection;
mod reach;
mod robot;
mod ros2;
mod sensor;
mod shapes;
mod simulation;
mod touch;

use std::{
    fs::{self, File},
    io::{self, Read as _},
    path::{Path, PathBuf},
};

use glam::DVec2;
use toml::de::{DeTable, DeValue};

use self::objection::{Objection, Result, all_within, refuse_if, within};
use super::{
    Hurry, MOST_CORNERS, MOST_TARGETS, MOST_ZONES, Method, Mission, Perimeter, Sensors, Waypoint,
    error::MissionError,
};
use crate::{BatteryLimits, Physics, geometry::Zone, grid::MIN_CELLS};

/// Bounds reading of an endless file; a mission has a page or two.
const MAX_BYTES: u64 = 8 << 20;

fn read_bounded(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    // Opening a pipe would block until it has a writer.
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::other("it is not a regular file"));
    }
    let read = File::open(path)?.take(MAX_BYTES).read_to_string(&mut text)?;
    if read as u64 == MAX_BYTES {
        return Err(io::Error::other(format!("its size is {MAX_BYTES} bytes or more")));
    }
    Ok(text)
}

const MAX_TIMEOUT_S: f64 = 86_400.0;

impl Mission {
    /// # Errors
    /// Returns the line, the key, the fault and the remedy; `origin` names the file.
    pub fn parse(text: &str, origin: impl AsRef<Path>) -> Result<Self, MissionError> {
        let origin = origin.as_ref();
        let syntax = |error: &toml::de::Error| {
            let line = error.span().map_or(1, |span| line_of(text, span.start));
            unreadable(origin, line, &error.message().trim().replace('\n', " "))
        };
        let refused = |offset: usize, key, problem, remedy| MissionError::Value {
            file: origin.to_path_buf(),
            line: line_of(text, offset),
            key,
            problem,
            remedy,
        };
        let tree = DeTable::parse(text).map_err(|error| syntax(&error))?;
        let mut mission: Self = toml::from_str(text).map_err(|error| syntax(&error))?;
        if let Ok(read) = toml::Value::try_from(&mission)
            && let Some((start, key, problem)) = dropped("", tree.get_ref(), &read)
        {
            return Err(refused(start, key, problem, "remove the others".to_owned()));
        }
        if !tree.get_ref().contains_key("target") {
            mission.target = match mission.targets.first() {
                Some(first) => first.at,
                // The robot stays at its start.
                None if mission.stay => mission.start.at,
                None => {
                    return Err(unreadable(
                        origin,
                        1,
                        "missing field `target`, or `stay = true` to wait for one",
                    ));
                }
            };
        }
        if mission.name.is_empty() {
            mission.name = origin.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        }
        mission.remarks = remarks(text, origin, tree.get_ref(), &mission);
        Checker::default().run(&mission).map_err(|Objection { key, problem, remedy }| {
            refused(span_of(tree.get_ref(), key), key.to_owned(), problem, remedy)
        })?;
        assert!(mission.target.is_finite() && mission.contains(mission.start.at));
        assert!(mission.speed_m_s() > 0.0 && mission.turn_rad_s() > 0.0);
        Ok(mission)
    }

    /// # Errors
    /// As [`Mission::parse`], or if the file cannot be read.
    pub fn load(path: &Path) -> Result<Self, MissionError> {
        Self::parse(&Self::read(path)?, path)
    }

    /// # Errors
    /// If the file cannot be read or is too long.
    pub fn read(path: &Path) -> Result<String, MissionError> {
        read_bounded(path)
            .map_err(|source| MissionError::Unreadable { file: PathBuf::from(path), source })
    }
}

fn unreadable(origin: &Path, line: usize, problem: &str) -> MissionError {
    MissionError::Syntax { file: origin.to_path_buf(), line, problem: problem.to_owned() }
}

fn remarks(text: &str, origin: &Path, tree: &DeTable<'_>, mission: &Mission) -> Vec<String> {
    let remark = |key, remark: String| {
        format!("{}:{}: {key}: {remark}", origin.display(), line_of(text, span_of(tree, key)))
    };
    let looks = mission.method == Method::Evidential && mission.sensing;
    let car = mission.body().ackermann().filter(|_| looks).map(|car| {
        let radius = car.least_turning_radius();
        let text = format!("a car's turning radius is at least {radius:.2} m, so the robot starts driving without a turn on the spot to look around");
        remark("robot.model", text)
    });
    let robot = tree.get("robot").and_then(|value| value.get_ref().as_table());
    let has_odometry = robot.is_some_and(|robot| robot.contains_key("odometry"));
    let twice = (has_odometry && mission.robot.calibration.is_some()).then(|| {
        let text = "its values replace those of robot.odometry; remove one of them";
        remark("robot.calibration", text.to_owned())
    });
    let sight = mission.sight_speed_m_s();
    let blind = mission.controller.speed_m_s.filter(|asked| *asked > sight).map(|asked| {
        let text = format!("{asked} is more than the sensors' reach allows; the robot drives at {sight:.2} m/s at most, so that it stops on seen ground even if its sensors fall silent");
        remark("controller.speed_m_s", text)
    });
    let shut = mission.waypoints().into_iter().find(|to| reach::is_cut_off(mission, to.at)).map(|to| {
        let at = to.at;
        let radius = mission.body().radius_m;
        let key = if mission.targets.is_empty() { "target" } else { "targets" };
        let text = format!("known shapes and zones block every path to {at} for a body of {radius} m radius; move the target, or the shapes around it");
        remark(key, text)
    });
    let reversed = thresholds(mission).into_iter().filter(|(_, low, _, high)| low > high);
    let reversed = reversed.map(|(key, low, other, high)| {
        let text = format!(
            "{low} is more than {other} = {high}, its upper limit; swap the two, or change one"
        );
        remark(key, text)
    });
    [car, twice, blind, shut].into_iter().flatten().chain(reversed).collect()
}

/// Returns thresholds with a required order: key and value, then the key and value that must be at
/// least as great.
fn thresholds(mission: &Mission) -> [(&'static str, f64, &'static str, f64); 4] {
    let Physics { battery, heights, radio, .. } = mission.simulation.physics();
    let BatteryLimits { board, motor, servo } = mission.robot.low_battery_v;
    let clearance_m = heights.ground_clearance_m;
    [
        (
            "arrival_tolerance_m",
            mission.arrival_tolerance_m,
            "controller.slow_radius_m",
            mission.controller.slow_radius_m,
        ),
        (
            "robot.low_battery_v",
            board.max(motor).max(servo),
            "simulation.battery.start_v",
            battery.start_v,
        ),
        (
            "simulation.heights.ground_clearance_m",
            clearance_m,
            "simulation.heights.body_top_m",
            heights.body_top_m,
        ),
        (
            "simulation.radio.outage_mean_s",
            radio.outage_mean_s,
            "simulation.radio.outage_max_s",
            radio.outage_max_s,
        ),
    ]
}

/// Finds a list in the file that is longer than its parsed form `read`: its offset, key and
/// problem.
fn dropped(key: &str, file: &DeTable<'_>, read: &toml::Value) -> Option<(usize, String, String)> {
    file.iter().find_map(|(name, value)| {
        let key = if key.is_empty() { name.to_string() } else { format!("{key}.{name}") };
        dropped_of(&key, name.span().start, value.get_ref(), read.get(&**name.get_ref())?)
    })
}

fn dropped_of(
    key: &str,
    start: usize,
    file: &DeValue<'_>,
    read: &toml::Value,
) -> Option<(usize, String, String)> {
    match (file, read) {
        (DeValue::Table(file), read) => dropped(key, file, read),
        (DeValue::Array(file), toml::Value::Array(read)) if file.len() > read.len() => {
            let has = file.len();
            let takes = read.len();
            Some((start, key.to_owned(), format!("the list has {has} values instead of {takes}")))
        }
        (DeValue::Array(file), toml::Value::Array(read)) => file
            .iter()
            .zip(read)
            .find_map(|(file, read)| dropped_of(key, file.span().start, file.get_ref(), read)),
        _ => None,
    }
}

fn line_of(text: &str, offset: usize) -> usize {
    1 + text.bytes().take(offset).filter(|&byte| byte == b'\n').count()
}

/// Returns the offset of the deepest existing part of the dotted `key`; a default has no line.
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
    fn run(&mut self, mission: &Mission) -> Result {
        let plain = |c: char| c.is_alphanumeric() || "-_. ".contains(c);
        refuse_if(
            mission.name.starts_with('.') || !mission.name.chars().all(plain),
            "name",
            format!("{:?} is invalid as a directory name", mission.name),
            "use letters, digits, '-' and '_'",
        )?;
        refuse_if(
            mission.method == Method::Paper && mission.sensor_set() != Sensors::Front,
            "sensors",
            "the paper's method uses only the front sonar",
            "give \"front\", or method = \"evidential\"",
        )?;
        perimeter(mission)?;
        target(mission)?;
        all_within([
            ("timeout_s", mission.timeout_s, 1.0..=MAX_TIMEOUT_S, "s"),
            ("start", mission.start.heading_deg, -360.0..=360.0, "degrees of heading"),
        ])?;
        robot::check(mission)?;
        sensor::check(mission)?;
        touch::check(mission)?;
        ros2::check(mission)?;
        arduino::check(mission)?;
        stages(mission)?;
        self.shapes("known", &mission.known)?;
        zones(mission)?;
        self.shapes("world", &mission.world)?;
        self.simulation(&mission.simulation)?;
        start_is_free(mission)
    }
}

/// Most cells per side for which the stages meet their deadlines.
const MOST_DRIVEN_CELLS: u32 = 2048;

fn perimeter(mission: &Mission) -> Result {
    let perimeter = &mission.perimeter;
    within("perimeter.width_m", perimeter.width_m, 0.5..=1000.0, "m")?;
    let cells = mission.grid_frame().cells;
    refuse_if(
        !(MIN_CELLS..=MOST_DRIVEN_CELLS).contains(&cells),
        "perimeter.cells",
        format!("a grid of {cells} x {cells} cells is too small or too slow to solve"),
        format!("give {MIN_CELLS} to {MOST_DRIVEN_CELLS}"),
    )?;
    point("perimeter.centre", perimeter.centre)?;
    let start = mission.start.at;
    point("start", start)?;
    refuse_if(
        !mission.contains(start),
        "perimeter.centre",
        format!("the robot's start {start} is outside the perimeter"),
        "move the centre or widen perimeter.width_m",
    )
}

fn target(mission: &Mission) -> Result {
    let key = if mission.targets.is_empty() { "target" } else { "targets" };
    let Perimeter { width_m, centre, .. } = mission.perimeter;
    for Waypoint { at, heading_deg } in mission.waypoints() {
        point(key, at)?;
        refuse_if(
            !mission.contains(at),
            key,
            format!("{at} is outside the perimeter of {width_m} m around {centre}"),
            "move the target in, or widen perimeter.width_m",
        )?;
        within(key, heading_deg.unwrap_or_default(), -360.0..=360.0, "degrees of heading")?;
        refuse_if(
            heading_deg.is_some() && mission.body().steering.is_some(),
            key,
            "a car cannot turn on the spot to a target's heading",
            "give [x, y]",
        )?;
    }
    let count = mission.targets.len();
    let problem = format!("a list of {count} targets is too long");
    refuse_if(count > MOST_TARGETS, key, problem, format!("give 1 to {MOST_TARGETS}"))?;
    // A run file has both keys.
    let is_other = mission.targets.first().is_some_and(|first| first.at != mission.target);
    refuse_if(is_other, key, "target and targets are both given", "leave one of them out")?;
    all_within([
        ("arrival_tolerance_m", mission.arrival_tolerance_m, 0.01..=width_m / 2.0, "m"),
        ("sure_within_m", mission.sure_within_m, 0.01..=100.0, "m"),
    ])
}

fn point(key: &'static str, point: DVec2) -> Result {
    let problem = format!("{point} is not a position");
    refuse_if(!point.is_finite(), key, problem, "give two finite numbers in metres")
}

fn stages(mission: &Mission) -> Result {
    let Mission { controller, mapper, planner, perimeter, .. } = mission;
    let top = mission.body().top_speed_m_s;
    let Hurry { full_speed_within_deg: full, turns_beyond_deg: turns, look_rad_s, stops_within_s } =
        mission.hurry();
    let most_margin_m = perimeter.width_m / 4.0;
    // The check applies to the written value, before the sensors' reach limits it.
    let speed_m_s = mission.controller.speed_m_s.unwrap_or_else(|| mission.speed_m_s());
    all_within([
        ("controller.speed_m_s", speed_m_s, 0.001..=top, "m/s"),
        ("controller.turn_rad_s", mission.turn_rad_s(), 0.01..=20.0, "rad/s"),
        ("controller.look_rad_s", look_rad_s, 0.01..=20.0, "rad/s"),
        ("controller.turns_beyond_deg", turns, 2.0..=90.0, "degrees"),
        ("controller.full_speed_within_deg", full, 0.0..=turns - 1.0, "degrees"),
        ("planner.stops_within_s", stops_within_s, 0.05..=10.0, "s"),
        ("controller.slow_radius_m", controller.slow_radius_m, 0.001..=1000.0, "m"),
        ("controller.dead_zone", controller.dead_zone, 0.0..=0.9, ""),
        ("mapper.map_within_m", mission.map_within_m(), 0.04..=2.54, "m"),
        ("mapper.margin_m", mapper.margin_m, 0.0..=most_margin_m, "m"),
        ("mapper.clearance_m", mapper.clearance_m, 0.0..=1.0, "m"),
        ("mapper.forget_after_s", mapper.forget_after_s.unwrap_or(1e3), 10.0..=1e7, "s"),
    ])?;
    refuse_if(
        mission.speed_m_s() < 0.001,
        "controller.speed_m_s",
        "no sensor looks beyond the body, so no speed lets the robot stop on seen ground",
        "mount a sensor that looks ahead, or correct robot.radius_m",
    )?;
    refuse_if(
        mapper.forget_after_s.is_some() && mission.method == Method::Paper,
        "mapper.forget_after_s",
        "the map of the paper's method only grows",
        "leave the key out, or give method = \"evidential\"",
    )?;
    refuse_if(
        planner.executable == Some(PathBuf::new()),
        "planner.executable",
        "the path is empty",
        "name an executable, or leave the key out",
    )?;
    let plan = planner.calibration.clone().unwrap_or_default();
    // The grid cannot resolve a shorter length.
    let least = mission.grid_frame().resolution_m / 2.0;
    all_within([
        ("planner.calibration.ratio_sd", plan.ratio_sd, 0.0..=0.1, ""),
        ("planner.calibration.loops", f64::from(plan.loops), 6.0..=64.0, "loops"),
        ("planner.calibration.drive_m", plan.drive_m, 0.6..=10.0, "m"),
        ("planner.screening_m", planner.screening_m.unwrap_or(least), least..=1e6, "m"),
    ])
}

fn zones(mission: &Mission) -> Result {
    let zones = &mission.zones;
    let problem = format!("{} zones are too many", zones.len());
    refuse_if(zones.len() > MOST_ZONES, "zone", problem, format!("give at most {MOST_ZONES}"))?;
    for zone @ Zone { points } in zones {
        let count = points.len();
        refuse_if(
            !(3..=MOST_CORNERS).contains(&count),
            "zone",
            format!("a zone has {count} corners"),
            format!("give 3 to {MOST_CORNERS}"),
        )?;
        points.iter().try_for_each(|corner| point("zone", *corner))?;
        let problem = "two edges of a zone cross";
        refuse_if(zone.crosses_itself(), "zone", problem, "give its corners in order around it")?;
    }
    Ok(())
}

/// Greatest body radius in tracks; a greater one suggests a wrong unit.
const MOST_TRACKS: f64 = 5.0;

fn start_is_free(mission: &Mission) -> Result {
    let radius = mission.body().radius_m;
    let track = mission.body().track_m;
    refuse_if(
        radius > MOST_TRACKS * track,
        "robot.radius_m",
        format!("a radius of {radius} m is too large for a track of {track} m"),
        format!("give metres, at most {MOST_TRACKS} times the track"),
    )?;
    let start = mission.start.at;
    for (key, shapes) in [("world", &mission.obstacles()), ("known", &mission.known)] {
        let clearance = shapes.clearance(start);
        let problem = format!(
            "a shape stands {clearance:.2} m from the start, but the robot's radius is {radius} m"
        );
        refuse_if(clearance <= radius, key, problem, format!("move it away from {start}"))?;
        for Waypoint { at, .. } in mission.waypoints() {
            let which = if mission.targets.is_empty() { String::new() } else { format!(" {at}") };
            let problem = format!("the target{which} lies inside a shape");
            refuse_if(shapes.clearance(at) <= 0.0, key, problem, "move one of them")?;
        }
    }
    for zone in &mission.zones {
        let problem = "the robot starts in a zone, or overlaps one";
        refuse_if(zone.clearance(start) <= radius, "zone", problem, "move one of them")?;
        for Waypoint { at, .. } in mission.waypoints() {
            let problem = format!("the target {at} lies inside a zone");
            refuse_if(zone.clearance(at) <= 0.0, "zone", problem, "move one of them")?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
