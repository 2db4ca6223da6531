//! Worlds for an evaluation, drawn from a seed or read from files. Each is checked to be solvable for the body.

mod barn;
mod corridors;
mod ends;
mod files;
mod floor;
mod furnished;
mod moving;
mod rooms;
mod shapes;
mod traps;

use std::{convert::Infallible, fmt, path::PathBuf, str::FromStr};

pub use self::ends::Ends;
use self::{corridors::Bends, files::Asked, rooms::Doors};
use crate::{
    error::Result,
    missions::trial::{BodySize, Rules, Scene, Trial},
    random::Random,
};

/// Failed draws in a row after which a kind of world is taken for unsolvable.
const MOST_FAILURES: u64 = 10_000;
/// Start and target were given for worlds that have their own.
const NO_MAP: &str =
    "--start and --target are for ROS maps; give one to --worlds, or leave them out";

#[derive(Clone, Debug)]
pub enum Worlds {
    Drawn(&'static Kind),
    /// A file or a folder: a mission, a ROS map, a BARN `.world` or table of cylinders.
    Path(PathBuf),
}

#[derive(Debug)]
pub struct Kind {
    /// The stream of random numbers.
    stream: u64,
    name: &'static str,
    draw: fn(&mut Random, usize) -> Scene,
    rules: Rules,
}

const fn kind(stream: u64, name: &'static str, draw: fn(&mut Random, usize) -> Scene) -> Kind {
    Kind { stream, name, draw, rules: Rules::PLAIN }
}

static KINDS: [Kind; 10] = [
    kind(1, "rooms", |random, number| rooms::draw(random, number, Doors::Some)),
    kind(2, "doors", |random, number| rooms::draw(random, number, Doors::All)),
    kind(3, "traps", traps::draw),
    kind(4, "corridors", |random, _| corridors::draw(random, Bends::Oblique)),
    kind(5, "straight-corridors", |random, _| corridors::draw(random, Bends::None)),
    kind(6, "furnished", furnished::draw),
    // Stream 7 draws starts and targets on maps.
    kind(8, "rotated-rooms", |random, number| rooms::rotated(random, number, Doors::Some)),
    kind(9, "rotated-doors", |random, number| rooms::rotated(random, number, Doors::All)),
    kind(10, "glazed", rooms::glazed),
    Kind { rules: moving::RULES, ..kind(11, "moving-cylinders", moving::draw) },
];

impl FromStr for Worlds {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        let drawn = KINDS.iter().find(|kind| kind.name == text);
        Ok(drawn.map_or_else(|| Self::Path(text.into()), Self::Drawn))
    }
}

/// The name that [`FromStr`] reads.
impl fmt::Display for Worlds {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Drawn(kind) => to.write_str(kind.name),
            Self::Path(path) => path.display().fmt(to),
        }
    }
}

/// Trials, and the number of worlds that the body could not cross.
#[derive(Debug, Default)]
pub struct Found {
    pub trials: Vec<Trial>,
    pub unsolvable: usize,
}

impl Found {
    /// Add the trial `world` in `scene`, if `body` can cross the world.
    fn add(&mut self, world: String, scene: &Scene, rules: Rules, body: &BodySize) -> Result {
        self.add_solvable(Trial::new(world, scene, rules, body)?);
        Ok(())
    }

    fn add_solvable(&mut self, trial: Option<Trial>) {
        self.unsolvable += usize::from(trial.is_none());
        self.trials.extend(trial);
    }
}

/// `count` trials of `worlds` under `seed`; without a count all files. `ends` are only for maps.
pub fn find(
    worlds: &Worlds,
    count: Option<usize>,
    seed: u64,
    ends: Option<Ends>,
    body: &BodySize,
) -> Result<Found> {
    let found = match worlds {
        Worlds::Drawn(_) if ends.is_some() => return Err(NO_MAP.into()),
        Worlds::Drawn(kind) => draw_until(count.unwrap_or(100), seed, kind, body)?,
        Worlds::Path(path) => files::read(path, Asked { count, seed, ends }, body)?,
    };
    if found.trials.is_empty() {
        let swept_m = body.swept_m();
        return Err(format!(
            "none of the worlds can be crossed by a body of {swept_m:.2} m around its centre; give others, or a smaller robot"
        )
        .into());
    }
    Ok(found)
}

/// Draw worlds until `count` of them are solvable.
fn draw_until(count: usize, seed: u64, kind: &Kind, body: &BodySize) -> Result<Found> {
    let Kind { stream, name, draw, rules } = kind;
    let mut found = Found::default();
    for drawn in 0..MOST_FAILURES + count as u64 {
        let number = found.trials.len();
        if number >= count {
            break;
        }
        let scene = draw(&mut Random::of_world(seed, *stream, drawn), number);
        found.add(format!("{name}-{seed}-{number:04}"), &scene, *rules, body)?;
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
        for worlds in KINDS.iter().map(Worlds::Drawn) {
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
        for worlds in KINDS.iter().map(Worlds::Drawn) {
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
        let page = include_str!("../../../supervisor/guide/evaluation.md");
        for Kind { name, .. } in &KINDS {
            assert!(page.contains(&format!("\n| `{name}` | ")), "{name}");
        }
    }
}
