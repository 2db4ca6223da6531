//! Worlds from files: missions, BARN's worlds, ROS maps.

use std::{
    collections::BTreeSet,
    fmt::Display,
    fs::{self, File},
    io::{self, Read as _},
    path::{Path, PathBuf},
};

use common::mission::Mission;

use super::{
    Asked, Found, NO_MAP, barn,
    ends::{self, Ends},
    floor::Floor,
};
use simulation::Random;

use crate::{
    error::{Failure, Result},
    missions::trial::{Rules, Scene, Trial},
};

const DRAWN: usize = 10;
const DRAWN_KIND: u64 = 7;
const TESTS_FILE: &str = "config.txt";

pub fn unreadable<E: Display>(file: &Path) -> impl Fn(E) -> Failure {
    let file = file.display().to_string();
    move |cause| {
        format!("cannot read {file}: {cause}; give a kind of world, a file or a folder (`firsthand help evaluation`)").into()
    }
}

/// Returns the first `longest` bytes of a text file.
pub fn text(file: &Path, longest: u64) -> Result<String> {
    let mut text = String::new();
    File::open(file)
        .and_then(|opened| opened.take(longest).read_to_string(&mut text))
        .map_err(unreadable(file))?;
    Ok(text)
}

pub fn malformed(file: &Path, problem: impl Display) -> Failure {
    format!("{}: {problem}", file.display()).into()
}

/// Reads the worlds of a file, or of a folder and its subfolders, sorted by name. A requested
/// number is spread evenly over them.
pub fn read(path: &Path, asked: Asked) -> Result<Found> {
    let mut found = Found::default();
    if path.is_dir() {
        for file in files_of(path).map_err(unreadable(path))? {
            add(&mut found, &file, asked)?;
        }
    } else if !add(&mut found, path, asked)? {
        return Err(malformed(
            path,
            "not a world; give a mission (.toml), a ROS map (.yaml), a BARN world (.world) or its table of cylinders (cylinders.csv, .csv.gz)",
        ));
    }
    let mut names = BTreeSet::new();
    if let Some(twice) = found.trials.iter().find(|trial| !names.insert(&trial.mission.name)) {
        let world = &twice.mission.name;
        let problem = format!("two worlds have the name {world}; rename one");
        return Err(malformed(path, problem));
    }
    let all = found.trials.len();
    if let Some(count) = asked.count.filter(|&count| count < all) {
        let mut index = 0;
        found.trials.retain(|_| {
            index += 1;
            index * count / all > (index - 1) * count / all
        });
    }
    Ok(found)
}

fn files_of(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = |folder: &Path| -> io::Result<Vec<PathBuf>> {
        fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect()
    };
    let mut files = Vec::new();
    for path in entries(folder)? {
        if path.is_dir() {
            files.extend(entries(&path)?);
        } else {
            files.push(path);
        }
    }
    files.retain(|file| !file.is_dir());
    files.sort();
    Ok(files)
}

/// Adds the worlds of a file, by the end of its name. Returns whether it contains worlds.
fn add(found: &mut Found, file: &Path, asked: Asked) -> Result<bool> {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    if name.ends_with(".yaml") || name.ends_with(".yml") {
        add_map(found, file, asked)?;
        return Ok(true);
    }
    let worlds = if name.ends_with(".toml") {
        let mission = Mission::load(file)?.with_calibration()?;
        found.add(Trial::of_mission(mission, asked.swept_m));
        Vec::new()
    } else if name.ends_with(".world") {
        vec![barn::gazebo(file)?]
    } else if name.ends_with("cylinders.csv") || name.ends_with(".csv.gz") {
        barn::table(file)?
    } else {
        return Ok(false);
    };
    if asked.ends.is_some() {
        return Err(NO_MAP.into());
    }
    for (world, scene, rules) in worlds {
        found.add(Trial::new(&world, scene, rules, asked.swept_m)?);
    }
    Ok(true)
}

/// Adds a ROS map as worlds: with given ends, its tests, or drawn ends.
fn add_map(found: &mut Found, file: &Path, asked: Asked) -> Result {
    let floor = Floor::load(file)?;
    // A file called `map` gives its folder's name, as in MRPB.
    let mut name = file.file_stem().unwrap_or_default();
    if name == "map" {
        name = file.parent().and_then(Path::file_name).unwrap_or(name);
    }
    let tests = file.with_file_name(TESTS_FILE);
    let ends = match asked.ends {
        Some(ends) => vec![ends],
        None if tests.exists() => ends::read(&tests)?,
        None => {
            let count = asked.count.unwrap_or(DRAWN) as u64;
            let streams = (0..count).map(|number| Random::of_world(asked.seed, DRAWN_KIND, number));
            floor.draw(streams, asked.swept_m)
        }
    };
    for (number, Ends { start, heading, target }) in (1..).zip(ends) {
        let shapes = floor.shapes(file, start)?;
        // A start outside the free ground is unconnected.
        if shapes.is_empty() {
            found.unsolvable += 1;
            continue;
        }
        let scene = Scene { shapes, start, heading, target, ..Scene::default() };
        let world = format!("{}-{number}", name.display());
        found.add(Trial::new(&world, scene, Rules::PLAIN, asked.swept_m)?);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::worlds::testing::drawn;

    const ALL: Asked = Asked { count: None, seed: 1, ends: None, swept_m: 0.24 };
    const ENDS: Ends =
        Ends { start: DVec2::new(11.0, 21.0), heading: 0.0, target: DVec2::new(15.0, 22.0) };
    const WITH_ENDS: Asked = Asked { ends: Some(ENDS), ..ALL };

    fn names(found: &Found) -> Vec<&str> {
        found.trials.iter().map(|trial| &*trial.mission.name).collect()
    }

    /// Returns the map of a hall of 8 m by 3 m at (10.1, 20.1), its walls 1 m thick.
    fn hall() -> tempfile::TempDir {
        let map = "##########\n#........#\n#........#\n#........#\n##########";
        drawn(map, "resolution: 1\norigin: [9.1, 19.1, 0]")
    }

    #[test]
    fn a_count_takes_worlds_from_the_whole_of_a_folder() {
        let folder = tempfile::tempdir().unwrap();
        for number in 0..10 {
            let file = folder.path().join(format!("m{number}.toml"));
            fs::write(file, "target = [2, 0]").unwrap();
        }
        let count = Some(3);
        let found = read(folder.path(), Asked { count, ..ALL }).unwrap();
        assert_eq!(names(&found), ["m3", "m6", "m9"]);
    }

    #[test]
    fn a_map_is_a_world_with_the_ends_given_those_of_its_tests_or_drawn_ones() {
        let folder = hall();
        let drawn = read(folder.path(), ALL).unwrap();
        assert_eq!(drawn.trials.len(), DRAWN);

        let given = read(folder.path(), WITH_ENDS).unwrap();
        let mission = &given.trials[0].mission;
        assert_eq!(mission.target, DVec2::new(4.0, 1.0));
        let left_m = mission.world.clearance(DVec2::ZERO);
        assert!((left_m - 0.9).abs() < 1e-9, "the wall at the left: {left_m}");
        assert!((given.trials[0].shortest_m - 17_f64.sqrt()).abs() < 1e-9);

        let test = "<arg name='initial_pose_x' default='11'/><arg name='initial_pose_y' default='21'/>\
            <arg name='initial_pose_a' default='0'/><arg name='goal_pose_x' default='15'/>\
            <arg name='goal_pose_y' default='22'/>";
        fs::write(folder.path().join(TESTS_FILE), test).unwrap();
        let tested = read(folder.path(), ALL).unwrap();
        assert_eq!(names(&tested), ["hall-1"]);
        assert_eq!(&tested.trials[0].mission, mission);
    }

    #[test]
    fn what_cannot_be_a_world_is_refused_with_the_file_or_the_option() {
        let folder = hall();
        let assert_refused = |path: &Path, asked, named: &str| {
            let refused = read(path, asked).unwrap_err().to_string();
            assert!(refused.contains(named), "{refused}");
        };
        let image = "hall.pgm: not a world; give a mission (.toml), a ROS map (.yaml)";
        assert_refused(&folder.path().join("hall.pgm"), ALL, image);

        let mission = folder.path().join("mission.toml");
        fs::write(&mission, "target = [2, 0]").unwrap();
        assert_refused(&mission, WITH_ENDS, "--start");

        let twice = folder.path().join("twice");
        fs::create_dir(&twice).unwrap();
        fs::copy(&mission, twice.join("mission.toml")).unwrap();
        assert_refused(folder.path(), ALL, "two worlds have the name mission");
    }
}
