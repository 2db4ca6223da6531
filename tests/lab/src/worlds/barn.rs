//! Cylinder worlds of the BARN challenge, from its Gazebo `.world` files or a table of cylinders.
//!
//! The table (`world,x_m,y_m,radius_m`, plain or gzip) may have an `index.csv` beside it with each
//! world's optimal time. Otherwise the optimal time is that of the body's shortest path at 2 m/s.
//!
//! Start, goal and rules are the challenge's: from (-2.25, 3) with heading +y to (-2.25, 13).
//! Success is within 1 m and 100 s of a clock that starts after 0.1 m.

use std::{collections::BTreeMap, f64::consts::FRAC_PI_2, fs::File, io::Read, path::Path};

use common::geometry::{Drum, Shapes};
use glam::DVec2;
use serde::{Deserialize, de::DeserializeOwned};

use super::{
    files::{malformed, text, unreadable},
    shapes::{drum, wall, walls},
};
use crate::{
    error::Result,
    missions::trial::{Rules, Scene},
};

const START: DVec2 = DVec2::new(-2.25, 3.0);
const GOAL: DVec2 = DVec2::new(-2.25, 13.0);
/// Walls left, right and behind the start; the far side is open.
const SIDES_M: [f64; 2] = [-4.425, -0.075];
const BEHIND_M: f64 = 0.075;
const SIDES_END_M: f64 = 9.6;
/// A world file has some hundred kilobytes, the table of all worlds one megabyte.
const LONGEST: u64 = 64 << 20;
#[derive(Deserialize)]
struct Cylinder {
    world: u32,
    x_m: f64,
    y_m: f64,
    radius_m: f64,
}

#[derive(Deserialize)]
struct IndexRow {
    world: u32,
    optimal_time_s: f64,
}

pub type World = (String, Scene, Rules);

pub fn table(file: &Path) -> Result<Vec<World>> {
    let mut cylinders: BTreeMap<u32, Vec<Drum>> = BTreeMap::new();
    for Cylinder { world, x_m, y_m, radius_m } in rows(file)? {
        cylinders.entry(world).or_default().push(drum(DVec2::new(x_m, y_m), radius_m));
    }
    let index = file.with_file_name("index.csv");
    let index: Vec<IndexRow> = if index.exists() { rows(&index)? } else { Vec::new() };
    let times: BTreeMap<_, _> = index.iter().map(|row| (row.world, row.optimal_time_s)).collect();
    let world = |(number, drums)| {
        let optimal_time_s = times.get(&number).copied();
        (format!("barn-{number:03}"), scene(drums), Rules { optimal_time_s, ..RULES })
    };
    Ok(cylinders.into_iter().map(world).collect())
}

pub fn gazebo(file: &Path) -> Result<World> {
    let drums = cylinders(&text(file, LONGEST)?).ok_or_else(|| {
        malformed(file, "the file has no <model> with a <pose> and a <cylinder>; give a BARN world")
    })?;
    let name = file.file_stem().unwrap_or_default().display();
    Ok((format!("barn-{name}"), scene(drums), RULES))
}

/// Returns the cylinders of a world's models, each at its model's first `<pose>`; none without
/// cylinders.
fn cylinders(text: &str) -> Option<Vec<Drum>> {
    let world = roxmltree::Document::parse(text).ok()?;
    let mut drums = Vec::new();
    for model in world.descendants().filter(|node| node.has_tag_name("model")) {
        let text = |tag: &str| model.descendants().find(|node| node.has_tag_name(tag))?.text();
        let (Some(radius), Some(pose)) = (text("radius"), text("pose")) else {
            continue;
        };
        let mut pose = pose.split_whitespace().map(str::parse);
        if let (Ok(radius_m), Some(Ok(x)), Some(Ok(y))) =
            (radius.trim().parse(), pose.next(), pose.next())
        {
            drums.push(drum(DVec2::new(x, y), radius_m));
        }
    }
    // The world's state at the end of the file repeats the poses.
    drums.dedup();
    (!drums.is_empty()).then_some(drums)
}

fn scene(drums: Vec<Drum>) -> Scene {
    let [left, right] = SIDES_M;
    let sides = [(left, SIDES_END_M), (left, BEHIND_M), (right, BEHIND_M), (right, SIDES_END_M)];
    Scene {
        shapes: Shapes { drums, ..walls([wall(sides.map(DVec2::from))]) },
        start: START,
        heading: FRAC_PI_2,
        target: GOAL,
        ..Scene::default()
    }
}

pub const RULES: Rules = Rules {
    success_within_m: 1.0,
    clock_after_departure: true,
    most_s: Some(100.0),
    scored: true,
    optimal_time_s: None,
};

fn rows<T: DeserializeOwned>(file: &Path) -> Result<Vec<T>> {
    let opened = File::open(file).map_err(unreadable(file))?;
    let zipped = file.extension().is_some_and(|extension| extension == "gz");
    let table: Box<dyn Read> =
        if zipped { Box::new(flate2::read::GzDecoder::new(opened)) } else { Box::new(opened) };
    crate::rows(table.take(LONGEST)).map_err(|error| match error.kind() {
        csv::ErrorKind::Io(_) => unreadable(file)(error),
        _ => malformed(file, error),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cylinders_of_a_gazebo_world_are_read_with_their_places() {
        let text = "<world><model name='unit_cylinder_1'><pose frame=''>-1.5 2.25 0.5 0 0 0</pose>\
            <link><collision><geometry><cylinder><radius>0.075</radius><length>1</length></cylinder>\
            </geometry></collision></link></model><model name='ground'><pose>0 0 0</pose></model></world>";
        let want = Drum { at: DVec2::new(-1.5, 2.25), radius_m: 0.075, ..Drum::default() };
        assert_eq!(cylinders(text), Some(vec![want]));
        assert_eq!(cylinders("<world></world>"), None);
    }

    #[test]
    fn a_table_of_cylinders_gives_each_world_with_its_time_and_a_damaged_one_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("cylinders.csv");
        std::fs::write(&file, "world,x_m,y_m,radius_m\n7,0,5,0.075\n7,1,5,0.075\n9,0,6,0.1\n")
            .unwrap();
        std::fs::write(
            folder.path().join("index.csv"),
            "world,path_length_m,optimal_time_s\n7,12,6.2\n",
        )
        .unwrap();
        let worlds = table(&file).unwrap();
        let found: Vec<_> = worlds
            .iter()
            .map(|(name, scene, rules)| {
                (name.as_str(), scene.shapes.drums.len(), rules.optimal_time_s)
            })
            .collect();
        assert_eq!(found, [("barn-007", 2, Some(6.2)), ("barn-009", 1, None)]);
        std::fs::write(&file, "world,x_m,y_m,radius_m\n7,left,5,0.075\n").unwrap();
        let refused = table(&file).unwrap_err().to_string();
        let named = file.to_str().unwrap();
        assert!(refused.starts_with(named) && refused.contains("line: 2"), "{refused}");
    }
}
