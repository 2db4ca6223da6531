//! Shipped missions and mission files, with assignments.

use std::path::Path;

use common::mission::{Mission, MissionError};
use thiserror::Error;

macro_rules! shipped {
    ($($name:literal),*) => {
        [$(($name, include_str!(concat!("../../missions/", $name, ".toml")))),*]
    };
}

pub static SHIPPED: [(&str, &str); 6] =
    shipped!("open-room", "obstacle-course", "trap", "passage", "one-drum", "walkers");

#[derive(Debug, Error)]
pub enum LookupError {
    #[error("no shipped mission is called {name:?}; shipped are {}", names())]
    Unknown { name: String },
    #[error("{name:?} is neither a shipped mission ({}) nor a file", names())]
    Neither { name: String },
    #[error("{0}")]
    Assigned(String),
    #[error(transparent)]
    Mission(#[from] MissionError),
    #[error("{name} with the obstacles of its map: {problem}")]
    OnMap { name: String, problem: String },
    #[error("map: {0}")]
    Map(#[from] maps::MapError),
}

fn names() -> String {
    SHIPPED.map(|(name, _)| name).join(", ")
}

pub fn shipped(name: &str) -> Option<&'static str> {
    SHIPPED.iter().find(|(shipped, _)| *shipped == name).map(|(_, text)| *text)
}

/// Applies `KEY=VALUE` assignments, and the mission's calibration.
pub fn load(name: &str, assignments: &[String]) -> Result<Mission, LookupError> {
    let file = Path::new(name);
    match shipped(name) {
        Some(text) => parsed(text, &format!("{name}.toml"), assignments),
        None if file.extension().is_some() || file.exists() => {
            parsed(&Mission::read(file)?, name, assignments)
        }
        None => Err(LookupError::Neither { name: name.to_owned() }),
    }
}

/// Inlines the mission's files. Fails if one cannot be read.
fn complete(mission: Mission) -> Result<Mission, LookupError> {
    let mission = mission.with_calibration()?;
    let has_map = mission.map.is_some();
    let mission = maps::with_prior_map(mission)?;
    if has_map {
        // Start and targets may lie inside the map's obstacles.
        let failed = |problem| LookupError::OnMap { name: mission.name.clone(), problem };
        let text = toml::to_string(&mission).map_err(|error| failed(error.to_string()))?;
        Mission::parse(&text, &mission.name).map_err(|error| failed(error.without_place()))?;
    }
    Ok(mission)
}

pub fn parsed(text: &str, origin: &str, assignments: &[String]) -> Result<Mission, LookupError> {
    let as_written = Mission::parse(text, origin);
    // Validation follows all assignments, which may depend on each other.
    let table = text.parse::<toml::Table>();
    let (false, Ok(table)) = (assignments.is_empty(), table) else {
        return complete(as_written?);
    };
    let mission = Mission::parse(&assign(table, assignments)?, origin);
    complete(mission.map_err(|error| match as_written {
        // The file's own error names the line.
        Err(of_file) if of_file.is_same_fault(&error) => of_file.into(),
        // No line of the file is at fault.
        _ => {
            let (set, problem) = (assignments.join(" --set "), error.without_place());
            LookupError::Assigned(format!("{origin} with --set {set}: {problem}"))
        }
    })?)
}

fn assign(mut table: toml::Table, assignments: &[String]) -> Result<String, LookupError> {
    for assignment in assignments {
        let failed = |problem: &str| not_assigned(assignment, problem);
        let (path, _) = assignment.split_once('=').ok_or_else(|| failed("no '='"))?;
        let layer: toml::Table =
            toml::from_str(assignment).map_err(|error| failed(error.message()))?;
        if path.trim().is_empty() {
            return Err(failed("no key"));
        }
        merge(&mut table, layer);
    }
    toml::to_string(&table)
        .map_err(|error| not_assigned(&assignments.join(" "), &error.to_string()))
}

fn not_assigned(assignment: &str, problem: &str) -> LookupError {
    let problem = problem.trim().replace('\n', " ");
    LookupError::Assigned(format!(
        "--set {assignment:?} is not KEY=VALUE with a TOML value: {problem}; for example --set start.heading_deg=90"
    ))
}

fn merge(base: &mut toml::Table, layer: toml::Table) {
    for (key, value) in layer {
        match (base.get_mut(&key), value) {
            (Some(toml::Value::Table(below)), toml::Value::Table(above)) => merge(below, above),
            (_, value) => {
                base.insert(key, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shipped_mission_is_valid_and_says_what_it_is() {
        for (name, _) in SHIPPED {
            let mission = load(name, &[]).unwrap();
            assert_eq!(mission.name, name);
            assert!(!mission.description.is_empty(), "{name} has no description");
        }
    }

    #[test]
    fn the_mission_in_the_guide_is_valid_and_shows_the_defaults() {
        let guide = include_str!("../../guide/mission-file.md");
        let text = guide.split("```toml\n").nth(1).unwrap().split("```").next().unwrap();
        let mut shown = Mission::parse(text, "mission-file.md").unwrap();
        shown.known = common::geometry::Shapes::default();
        shown.zones = Vec::new();
        shown.world = common::geometry::Shapes::default();
        let plain = Mission::parse("target = [4.0, 0.0]", "mission-file.md").unwrap();
        assert_eq!(shown, plain);
    }

    #[test]
    fn an_assignment_changes_one_key_and_keeps_its_table() {
        let mission =
            load("trap", &["start.heading_deg=90".into(), "perimeter.cells = 60".into()]).unwrap();
        assert_eq!((mission.start.heading_deg, mission.perimeter.cells), (90.0, Some(60)));
        assert_eq!(mission.perimeter.width_m, 9.0, "the rest of the table stays");
    }

    #[test]
    fn values_are_judged_after_all_assignments_and_what_remains_wrong_is_told_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("far.toml");
        std::fs::write(&file, "\n\ntarget = [20, 0]").unwrap();
        let name = file.to_str().unwrap();
        let load = |set: &[&str]| {
            let set: Vec<String> = set.iter().map(|it| (*it).to_owned()).collect();
            load(name, &set)
        };
        let refused = |set: &[&str]| load(set).unwrap_err().to_string();
        assert!(refused(&[]).contains("far.toml:3: target"));
        assert!(refused(&["seed=3"]).contains("far.toml:3: target"));
        // The message cites the assignment, and no line of the file.
        let set = refused(&["perimeter.width_m=-1"]);
        assert!(set.contains("--set perimeter.width_m=-1: ") && !set.contains(".toml:"), "{set}");
        let too_far = refused(&["perimeter.width_m=12", "perimeter.centre=[10, 0]"]);
        assert!(too_far.contains("perimeter.centre"), "{too_far}");
        let mended = load(&["perimeter.width_m=24", "perimeter.centre=[10, 0]"]).unwrap();
        assert_eq!(mended.target, glam::DVec2::new(20.0, 0.0));
    }

    #[test]
    fn a_bad_assignment_is_refused() {
        for bad in ["heading", "start.heading_deg=", "start.headin=3", "=3"] {
            assert!(load("trap", &[bad.to_owned()]).is_err(), "{bad}");
        }
    }
}
