//! Systematic errors of the wheels: how far they differ from what the mission says.
//!
//! They are a property of the robot, not of the moment: drawn once from the seed of the mission, with a stream of their
//! own, and the same in each process of a run.

use common::mission::{Mission, WheelPhysics};

use crate::{
    body::Wheels,
    noise::{Noise, Source},
};

/// True sizes over nominal ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelErrors {
    /// Diameters; their mean is 1.
    pub diameter: Wheels<f64>,
    /// Track.
    pub track: f64,
}

impl WheelErrors {
    /// The errors of `mission`'s robot.
    pub fn of(mission: &Mission) -> Self {
        let WheelPhysics { diameter_ratio, diameter_spread, track_scale, track_spread, .. } =
            mission.simulation.physics().wheels;
        let mut noise = Noise::new(mission.seed, Source::WheelErrors);
        let mut off = |spread: f64| 1.0 + spread * (2.0 * noise.uniform() - 1.0);
        let ratio = diameter_ratio * off(diameter_spread);
        Self {
            diameter: Wheels { left: 2.0 / (1.0 + ratio), right: 2.0 * ratio / (1.0 + ratio) },
            track: track_scale * off(track_spread),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn errors(text: &str) -> WheelErrors {
        let text = format!("target = [3, 0]\n{text}");
        WheelErrors::of(&Mission::parse(&text, Path::new("m.toml")).unwrap())
    }

    #[test]
    fn wheels_in_the_laboratory_are_exactly_the_nominal_ones() {
        let exact = WheelErrors { diameter: Wheels { left: 1.0, right: 1.0 }, track: 1.0 };
        assert_eq!(errors("seed = 7"), exact);
    }

    #[test]
    fn each_seed_has_wheels_of_its_own_within_the_spread() {
        let robots = (1..=200)
            .map(|seed| errors(&format!("seed = {seed}\nsimulation.realism = 'measured'")));
        let (mut ratios, mut tracks) = (Vec::new(), Vec::new());
        for robot in robots {
            ratios.push(robot.diameter.right / robot.diameter.left - 1.0);
            tracks.push(robot.track - 1.0);
        }
        for off in [ratios, tracks] {
            assert!(off.iter().all(|off| off.abs() <= 0.005 + 1e-12));
            let most = off.iter().copied().fold(f64::MIN, f64::max);
            let least = off.iter().copied().fold(f64::MAX, f64::min);
            assert!(most > 0.0045 && least < -0.0045, "{least} to {most}");
        }
    }
}
