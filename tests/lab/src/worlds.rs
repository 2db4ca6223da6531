//! Solvable worlds for an evaluation, drawn from a seed or read from files.

mod barn;
mod corridors;
pub mod ends;
mod files;
mod floor;
mod furnished;
mod moving;
mod people;
mod rooms;
mod shapes;
#[cfg(test)]
mod testing;
mod traps;

use self::{ends::Ends, rooms::Doors};
use simulation::Random;

use crate::{
    error::Result,
    missions::trial::{Rules, Scene, Trial},
};

/// Failed draws in a row after which a kind of world counts as unsolvable.
const MOST_FAILURES: u64 = 10_000;
const NO_MAP: &str = "--start and --target need a ROS map; give one to --worlds, or remove both";

struct Kind {
    stream: u64,
    name: &'static str,
    draw: fn(&mut Random, usize) -> Scene,
    rules: Rules,
}

const fn kind(stream: u64, name: &'static str, draw: fn(&mut Random, usize) -> Scene) -> Kind {
    Kind { stream, name, draw, rules: Rules::PLAIN }
}

static KINDS: [Kind; 12] = [
    kind(1, "rooms", |random, number| rooms::draw(random, number, Doors::Some)),
    kind(2, "doors", |random, number| rooms::draw(random, number, Doors::All)),
    kind(3, "traps", traps::draw),
    kind(4, "corridors", |random, _| corridors::oblique(random)),
    kind(5, "straight-corridors", |random, _| corridors::straight(random)),
    kind(6, "furnished", furnished::draw),
    // Stream 7 draws starts and targets on maps.
    kind(8, "rotated-rooms", |random, number| rooms::rotated(random, number, Doors::Some)),
    kind(9, "rotated-doors", |random, number| rooms::rotated(random, number, Doors::All)),
    kind(10, "glazed", rooms::glazed),
    Kind { rules: moving::RULES, ..kind(11, "moving-cylinders", moving::draw) },
    kind(12, "people", people::draw),
    kind(13, "meeting", |random, _| rooms::meeting(random)),
];

/// Trials, and the number of worlds that the body cannot cross.
#[derive(Debug, Default)]
pub struct Found {
    pub trials: Vec<Trial>,
    pub unsolvable: usize,
}

impl Found {
    fn add(&mut self, trial: Option<Trial>) {
        self.unsolvable += usize::from(trial.is_none());
        self.trials.extend(trial);
    }
}

#[derive(Clone, Copy)]
pub struct Asked {
    /// By default a hundred drawn worlds, all files, and ten on each map without tests.
    pub count: Option<usize>,
    pub seed: u64,
    pub ends: Option<Ends>,
    pub swept_m: f64,
}

/// Finds the worlds of a kind, or of a file or folder: a mission, a ROS map, a BARN `.world` or
/// table of cylinders.
pub fn find(worlds: &str, asked: Asked) -> Result<Found> {
    let found = match KINDS.iter().find(|kind| kind.name == worlds) {
        Some(_) if asked.ends.is_some() => return Err(NO_MAP.into()),
        Some(kind) => draw(kind, asked)?,
        None => files::read(worlds.as_ref(), asked)?,
    };
    if found.trials.is_empty() {
        return Err(format!(
            "a body of {:.2} m around its centre can cross no world; give other worlds or a smaller robot",
            asked.swept_m
        )
        .into());
    }
    Ok(found)
}

fn draw(&Kind { stream, name, draw, rules }: &Kind, asked: Asked) -> Result<Found> {
    let (count, seed) = (asked.count.unwrap_or(100), asked.seed);
    let mut found = Found::default();
    for drawn in 0..MOST_FAILURES + count as u64 {
        let number = found.trials.len();
        if number >= count {
            break;
        }
        let scene = draw(&mut Random::of_world(seed, stream, drawn), number);
        let world = format!("{name}-{seed}-{number:04}");
        found.add(Trial::new(&world, scene, rules, asked.swept_m)?);
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use common::mission::{Heights, Mission, Realism};

    use super::*;

    const ASKED: Asked = Asked { count: Some(6), seed: 3, ends: None, swept_m: 0.24 };

    #[test]
    fn a_seed_gives_the_same_worlds_and_another_others() {
        for Kind { name, .. } in &KINDS {
            let missions = |seed| -> Vec<Mission> {
                let found = find(name, Asked { seed, ..ASKED }).unwrap();
                found.trials.into_iter().map(|trial| trial.mission).collect()
            };
            assert_eq!(missions(1), missions(1), "{name}");
            assert_ne!(missions(1), missions(2), "{name}");
        }
    }

    #[test]
    fn every_world_can_be_crossed_and_nothing_stands_in_the_robot() {
        for Kind { name, .. } in &KINDS {
            for trial in find(name, Asked { count: Some(20), ..ASKED }).unwrap().trials {
                let mission = &trial.mission;
                let name = &mission.name;
                assert!(trial.shortest_m >= mission.target.length() - 1e-9, "{name}");
                assert!(trial.shortest_m < 5.0 * mission.target.length(), "{name}");
                let touched = Heights::preset(Realism::default()).touched(&mission.world);
                for place in [glam::DVec2::ZERO, mission.target] {
                    assert!(touched.clearance(place) > 0.19, "{name}");
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
