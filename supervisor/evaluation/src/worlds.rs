//! Worlds to try a robot on: drawn from a seed, or read from files. Each was checked to be solvable for the body.

mod barn;
mod corridors;
mod error;
mod random;
mod rooms;
mod traps;

use std::{
    convert::Infallible,
    fmt, fs,
    path::{Path, PathBuf},
    str::FromStr,
};

use common::mission::Mission;

pub use self::error::WorldError;
use self::{corridors::Bends, random::Random, rooms::Doors};
use crate::{
    shortest_path::{ShortestPath, shortest_path},
    trial::{BodySize, Rules, Scene, Trial},
};

/// Draws that may fail in a row before a kind of world is taken for unsolvable.
const MOST_FAILURES: u64 = 10_000;

/// Where worlds come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Worlds {
    /// Rooms, one in three with a door.
    Rooms,
    /// Rooms, all with a door.
    Doors,
    /// U traps of walls and of drums.
    Traps,
    /// Corridors with bends.
    Corridors,
    /// Straight empty corridors from 0.8 m.
    StraightCorridors,
    /// A file or a folder: a mission, a BARN `.world` or table of cylinders.
    Path(PathBuf),
}

/// Kinds that are drawn, by their names.
const DRAWN: [(&str, Worlds); 5] = [
    ("rooms", Worlds::Rooms),
    ("doors", Worlds::Doors),
    ("traps", Worlds::Traps),
    ("corridors", Worlds::Corridors),
    ("straight-corridors", Worlds::StraightCorridors),
];

impl FromStr for Worlds {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        let drawn = DRAWN.into_iter().find(|(name, _)| *name == text);
        Ok(drawn.map_or_else(|| Self::Path(text.into()), |(_, worlds)| worlds))
    }
}

/// As [`FromStr`] reads it.
impl fmt::Display for Worlds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self, DRAWN.iter().find(|(_, worlds)| worlds == self)) {
            (Self::Path(path), _) => path.display().fmt(f),
            (_, found) => f.write_str(found.map_or("", |(name, _)| name)),
        }
    }
}

/// Trials, and what was left out on the way to them.
#[derive(Debug, Default)]
pub struct Found {
    /// Each solvable.
    pub trials: Vec<Trial>,
    /// Worlds that the body could not cross.
    pub unsolvable: usize,
}

/// `count` trials of `worlds` under `seed`; of files all, without a count.
///
/// # Errors
/// When a file cannot be read, or no world can be crossed.
pub fn find(
    worlds: &Worlds,
    count: Option<usize>,
    seed: u64,
    body: &BodySize,
) -> Result<Found, WorldError> {
    let drawn = |kind: u64, name: &str, draw: &dyn Fn(&mut Random, usize) -> Scene| {
        draw_until(count.unwrap_or(100), seed, kind, name, body, draw)
    };
    let found = match worlds {
        Worlds::Rooms => drawn(1, "rooms", &|random, number| {
            rooms::draw(random, number, Doors::Some)
        })?,
        Worlds::Doors => drawn(2, "doors", &|random, number| {
            rooms::draw(random, number, Doors::All)
        })?,
        Worlds::Traps => drawn(3, "traps", &traps::draw)?,
        Worlds::Corridors => drawn(4, "corridors", &|random, _| {
            corridors::draw(random, Bends::Oblique)
        })?,
        Worlds::StraightCorridors => drawn(5, "straight-corridors", &|random, _| {
            corridors::draw(random, Bends::None)
        })?,
        Worlds::Path(path) => from_path(path, count, body)?,
    };
    if found.trials.is_empty() {
        return Err(WorldError::Unsolvable {
            swept_m: body.swept_m(),
        });
    }
    Ok(found)
}

/// Draw worlds until `count` of them are solvable.
fn draw_until(
    count: usize,
    seed: u64,
    kind: u64,
    name: &str,
    body: &BodySize,
    draw: &dyn Fn(&mut Random, usize) -> Scene,
) -> Result<Found, WorldError> {
    let mut found = Found::default();
    let mut drawn = 0;
    while found.trials.len() < count && drawn < MOST_FAILURES + count as u64 {
        let number = found.trials.len();
        let scene = draw(&mut Random::new(seed, kind, drawn), number);
        drawn += 1;
        let world = format!("{name}-{seed}-{number:04}");
        match Trial::new(world, &scene, Rules::default(), body)? {
            Some(trial) => found.trials.push(trial),
            None => found.unsolvable += 1,
        }
    }
    Ok(found)
}

/// The worlds of a file, or of every file in a folder that is one, by name; `count` of them spread evenly.
fn from_path(path: &Path, count: Option<usize>, body: &BodySize) -> Result<Found, WorldError> {
    let mut files = vec![path.to_path_buf()];
    if path.is_dir() {
        files = fs::read_dir(path)
            .and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect())
            .map_err(WorldError::unreadable(path))?;
        files.retain(|file| Kind::of(file).is_some());
        files.sort();
    }
    let mut found = Found::default();
    for file in &files {
        let scenes = match Kind::of(file) {
            Some(Kind::Mission) => {
                add_mission(&mut found, file, body)?;
                continue;
            }
            Some(Kind::Gazebo) => vec![barn::gazebo(file)?],
            Some(Kind::Cylinders) => barn::table(file)?,
            None => {
                return Err(WorldError::malformed(
                    file,
                    "not a world; give a mission (.toml), a BARN .world or a table of its cylinders (cylinders.csv, .csv.gz)",
                ));
            }
        };
        for (world, scene, rules) in scenes {
            match Trial::new(world, &scene, rules, body)? {
                Some(mut trial) => {
                    trial.mission.timeout_s = barn::TIMEOUT_S;
                    trial.mission.arrival_tolerance_m = rules.success_within_m * 0.7;
                    found.trials.push(trial);
                }
                None => found.unsolvable += 1,
            }
        }
    }
    if let Some(count) = count {
        spread(&mut found.trials, count);
    }
    Ok(found)
}

/// Keep `count` of `trials`, evenly spread over them.
fn spread(trials: &mut Vec<Trial>, count: usize) {
    let all = trials.len();
    if count < all {
        let mut index = 0;
        trials.retain(|_| {
            let before = index * count / all;
            index += 1;
            index * count / all > before
        });
    }
}

/// A mission file as a world.
fn add_mission(found: &mut Found, file: &Path, body: &BodySize) -> Result<(), WorldError> {
    let mission = Mission::load(file)?;
    let path = shortest_path(
        &mission.obstacles(),
        mission.start_pose().position,
        mission.target,
        body.swept_m(),
    );
    match path {
        ShortestPath::Found(shortest_m) => found.trials.push(Trial {
            world: mission.name.clone(),
            mission,
            shortest_m,
            rules: Rules::default(),
        }),
        ShortestPath::None | ShortestPath::TooLarge => found.unsolvable += 1,
    }
    Ok(())
}

/// What a file holds, by its name.
#[derive(Clone, Copy)]
enum Kind {
    Mission,
    Gazebo,
    Cylinders,
}

impl Kind {
    fn of(file: &Path) -> Option<Self> {
        let name = file.file_name()?.to_string_lossy();
        if name.ends_with(".toml") {
            Some(Self::Mission)
        } else if name.ends_with(".world") {
            Some(Self::Gazebo)
        } else if name.ends_with("cylinders.csv") || name.ends_with(".csv.gz") {
            Some(Self::Cylinders)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BODY: BodySize = BodySize {
        radius_m: 0.19,
        margin_m: 0.05,
    };

    #[test]
    fn a_seed_gives_the_same_worlds_and_another_others() {
        for worlds in [
            Worlds::Rooms,
            Worlds::Doors,
            Worlds::Traps,
            Worlds::Corridors,
            Worlds::StraightCorridors,
        ] {
            let missions = |seed| -> Vec<Mission> {
                let found = find(&worlds, Some(6), seed, &BODY).unwrap();
                found
                    .trials
                    .into_iter()
                    .map(|trial| trial.mission)
                    .collect()
            };
            assert_eq!(missions(1), missions(1), "{worlds:?}");
            assert_ne!(missions(1), missions(2), "{worlds:?}");
        }
    }

    #[test]
    fn every_world_can_be_crossed_and_nothing_stands_in_the_robot() {
        for worlds in [
            Worlds::Rooms,
            Worlds::Doors,
            Worlds::Traps,
            Worlds::Corridors,
        ] {
            for trial in find(&worlds, Some(20), 3, &BODY).unwrap().trials {
                let mission = &trial.mission;
                let name = &trial.world;
                assert!(trial.shortest_m >= mission.target.length() - 1e-9, "{name}");
                assert!(trial.shortest_m < 5.0 * mission.target.length(), "{name}");
                for place in [glam::DVec2::ZERO, mission.target] {
                    assert!(mission.world.clearance(place) > BODY.radius_m, "{name}");
                }
            }
        }
    }

    #[test]
    fn a_count_takes_worlds_from_the_whole_of_a_folder() {
        let folder = tempfile::tempdir().unwrap();
        for number in 0..10 {
            let file = folder.path().join(format!("m{number}.toml"));
            fs::write(file, "target = [2, 0]").unwrap();
        }
        let worlds = Worlds::Path(folder.path().to_path_buf());
        let found = find(&worlds, Some(3), 1, &BODY).unwrap();
        let names: Vec<_> = found.trials.iter().map(|trial| &*trial.world).collect();
        assert_eq!(names, ["m3", "m6", "m9"]);
    }
}
