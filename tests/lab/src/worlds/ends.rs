//! Starts and targets on a map: given, or from the file `config.txt` of an MRPB map, which has
//! three tests:
//!
//! ```text
//! <arg name="initial_pose_x" default="-12.5"/>
//! ```
//!
//! and `initial_pose_y`, `initial_pose_a` (radians), `goal_pose_x`, `goal_pose_y`. The goal's
//! heading is unused.

use std::path::Path;

use glam::DVec2;

use super::files::{malformed, text};
use crate::error::Result;

/// Such a file has some twenty short lines.
const LONGEST: u64 = 64 << 10;
const KEYS: [&str; 5] =
    ["initial_pose_x", "initial_pose_y", "initial_pose_a", "goal_pose_x", "goal_pose_y"];

/// Start and target of a mission, in its map's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ends {
    pub start: DVec2,
    /// Counter-clockwise from x.
    pub heading: f64,
    pub target: DVec2,
}

pub fn read(file: &Path) -> Result<Vec<Ends>> {
    // Opening a pipe would wait for its other end, so the check comes first.
    if !file.is_file() {
        return Err(malformed(file, "not a regular file; give MRPB's tests"));
    }
    parse(&text(file, LONGEST)?).map_err(|problem| malformed(file, problem))
}

/// Allows up to 1000 km.
pub fn number(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|number: &f64| number.abs() <= 1e6)
}

fn parse(text: &str) -> Result<Vec<Ends>, String> {
    let text = format!("<tests>{text}</tests>");
    let tests = roxmltree::Document::parse(&text).map_err(|cause| cause.to_string())?;
    let mut values = Vec::new();
    for node in tests.descendants() {
        if let Some((key, value)) = node.attribute("name").zip(node.attribute("default"))
            && KEYS.contains(&key)
        {
            let wrong = || format!("{key} is {value:?}; give metres or radians");
            values.push((key, number(value).ok_or_else(wrong)?));
        }
    }
    if values.is_empty() {
        return Err("no <arg name=\"initial_pose_x\" default=\"...\"/>; give MRPB's tests, or remove the file for random starts and targets".to_owned());
    }
    let ends = |(number, test): (usize, &[(&str, f64)])| {
        let value = |key: &str| {
            let found = test.iter().find(|(name, _)| *name == key).map(|(_, value)| *value);
            found.ok_or_else(|| format!("test {number} has no {key}; add it"))
        };
        let [x, y, heading, to_x, to_y] = KEYS.map(value);
        Ok(Ends { start: DVec2::new(x?, y?), heading: heading?, target: DVec2::new(to_x?, to_y?) })
    };
    (1..).zip(values.chunks(KEYS.len())).map(ends).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEST: &str = "# Test 1\n<arg name=\"initial_pose_x\" default=\"-1.5\"/>\n\
        <arg name=\"initial_pose_y\" default=\"2\"/>\n<arg name=\"initial_pose_a\" default=\"1.571\"/>\n\n\
        <arg name=\"goal_pose_x\" default=\"3\"/>\n<arg name=\"goal_pose_y\" default=\"4.25\"/>\n\
        <arg name=\"goal_pose_a\" default=\"0.0\"/>\n";

    #[test]
    fn each_test_of_a_file_gives_its_start_and_target() {
        let ends = parse(&[TEST, TEST].concat()).unwrap();
        let want =
            Ends { start: DVec2::new(-1.5, 2.0), heading: 1.571, target: DVec2::new(3.0, 4.25) };
        assert_eq!(ends, [want, want]);
    }

    #[test]
    fn a_damaged_file_is_refused_with_what_is_wrong() {
        for (text, named) in [
            (String::new(), "initial_pose_x"),
            (TEST.replace("4.25", "wall"), "goal_pose_y"),
            (TEST.replace("4.25", "inf"), "goal_pose_y"),
            (TEST.replace("goal_pose_x", "goal"), "no goal_pose_x"),
            (TEST.replace("goal_pose_x\"", "goal_pose_x"), " at "),
        ] {
            let refused = parse(&text).unwrap_err();
            assert!(refused.contains(named), "{refused}");
        }
    }
}
