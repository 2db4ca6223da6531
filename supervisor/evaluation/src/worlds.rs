//! Worlds for an evaluation, drawn from a seed or read from files. Each is checked to be solvable for the body.

mod barn;
mod corridors;
mod ends;
mod error;
mod files;
mod floor;
mod found;
mod furnished;
mod random;
mod rooms;
mod traps;

use std::{convert::Infallible, fmt, path::PathBuf, str::FromStr};

use self::{corridors::Bends, files::Asked, random::Random, rooms::Doors};
pub use self::{ends::Ends, error::WorldError, found::Found};
use crate::trial::{BodySize, Rules, Scene};

/// Failed draws in a row after which a kind of world is taken for unsolvable.
const MOST_FAILURES: u64 = 10_000;

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
    /// Rooms with tables, chairs, low and soft things.
    Furnished,
    /// A file or a folder: a mission, a ROS map, a BARN `.world` or table of cylinders.
    Path(PathBuf),
}

/// Kinds that are drawn, by their names.
const DRAWN: [(&str, Worlds); 6] = [
    ("rooms", Worlds::Rooms),
    ("doors", Worlds::Doors),
    ("traps", Worlds::Traps),
    ("corridors", Worlds::Corridors),
    ("straight-corridors", Worlds::StraightCorridors),
    ("furnished", Worlds::Furnished),
];

impl FromStr for Worlds {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        let drawn = DRAWN.into_iter().find(|(name, _)| *name == text);
        Ok(drawn.map_or_else(|| Self::Path(text.into()), |(_, worlds)| worlds))
    }
}

/// The name that [`FromStr`] reads.
impl fmt::Display for Worlds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self, DRAWN.iter().find(|(_, worlds)| worlds == self)) {
            (Self::Path(path), _) => path.display().fmt(f),
            (_, found) => f.write_str(found.map_or("", |(name, _)| name)),
        }
    }
}

/// `count` trials of `worlds` under `seed`; without a count all files. `ends` are only for maps.
pub fn find(
    worlds: &Worlds,
    count: Option<usize>,
    seed: u64,
    ends: Option<Ends>,
    body: &BodySize,
) -> Result<Found, WorldError> {
    if ends.is_some() && !matches!(worlds, Worlds::Path(_)) {
        return Err(WorldError::NoMap);
    }
    let drawn = |kind: u64, name: &str, draw: &dyn Fn(&mut Random, usize) -> Scene| {
        draw_until(count.unwrap_or(100), seed, kind, name, body, draw)
    };
    let found = match worlds {
        Worlds::Rooms => {
            drawn(1, "rooms", &|random, number| rooms::draw(random, number, Doors::Some))?
        }
        Worlds::Doors => {
            drawn(2, "doors", &|random, number| rooms::draw(random, number, Doors::All))?
        }
        Worlds::Traps => drawn(3, "traps", &traps::draw)?,
        Worlds::Corridors => {
            drawn(4, "corridors", &|random, _| corridors::draw(random, Bends::Oblique))?
        }
        Worlds::StraightCorridors => {
            drawn(5, "straight-corridors", &|random, _| corridors::draw(random, Bends::None))?
        }
        Worlds::Furnished => drawn(6, "furnished", &furnished::draw)?,
        Worlds::Path(path) => files::read(path, Asked { count, seed, ends }, body)?,
    };
    if found.trials.is_empty() {
        return Err(WorldError::Unsolvable { swept_m: body.swept_m() });
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
        found.add(world, &scene, Rules::default(), body)?;
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use common::mission::{Heights, Mission, Realism};

    use super::*;

    const BODY: BodySize = BodySize { radius_m: 0.19, margin_m: 0.05 };

    #[test]
    fn a_seed_gives_the_same_worlds_and_another_others() {
        for worlds in [
            Worlds::Rooms,
            Worlds::Doors,
            Worlds::Traps,
            Worlds::Corridors,
            Worlds::StraightCorridors,
            Worlds::Furnished,
        ] {
            let missions = |seed| -> Vec<Mission> {
                let found = find(&worlds, Some(6), seed, None, &BODY).unwrap();
                found.trials.into_iter().map(|trial| trial.mission).collect()
            };
            assert_eq!(missions(1), missions(1), "{worlds:?}");
            assert_ne!(missions(1), missions(2), "{worlds:?}");
        }
    }

    #[test]
    fn every_world_can_be_crossed_and_nothing_stands_in_the_robot() {
        for worlds in
            [Worlds::Rooms, Worlds::Doors, Worlds::Traps, Worlds::Corridors, Worlds::Furnished]
        {
            for trial in find(&worlds, Some(20), 3, None, &BODY).unwrap().trials {
                let mission = &trial.mission;
                let name = &trial.world;
                assert!(trial.shortest_m >= mission.target.length() - 1e-9, "{name}");
                assert!(trial.shortest_m < 5.0 * mission.target.length(), "{name}");
                let touched = Heights::preset(Realism::default()).touched(&mission.world);
                for place in [glam::DVec2::ZERO, mission.target] {
                    assert!(touched.clearance(place) > BODY.radius_m, "{name}");
                }
            }
        }
    }

    #[test]
    fn the_guide_has_every_kind_of_world() {
        let page = include_str!("../../guide/evaluation.md");
        for (name, _) in DRAWN {
            assert!(page.contains(&format!("\n| `{name}` | ")), "{name}");
        }
    }
}
