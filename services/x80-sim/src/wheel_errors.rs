//! Systematic errors of the wheels.
//!
//! They belong to the robot: a stream of their own draws them once from the mission's seed, so all
//! processes of a run agree.

use common::mission::Mission;

use crate::noise::{Noise, Source};

/// Ratios of true to nominal values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelErrors {
    /// Left and right wheel; their mean is 1.
    pub diameter: [f64; 2],
    pub track: f64,
    /// Share of the rolled distance lost to slip; negative for a gain.
    pub slip_share: f64,
}

impl WheelErrors {
    pub fn of(mission: &Mission) -> Self {
        let physics = mission.simulation.physics().wheels;
        let mut noise = Noise::new(mission.seed, Source::WheelErrors);
        let ratio = physics.diameter_ratio * (1.0 + noise.within(physics.diameter_spread));
        let diameter = [2.0, 2.0 * ratio].map(|share| share / (1.0 + ratio));
        assert!((diameter[0] + diameter[1] - 2.0).abs() < 1e-9);
        Self {
            diameter,
            track: physics.track_scale * (1.0 + noise.within(physics.track_spread)),
            slip_share: physics.slip_share + noise.within(physics.slip_share_spread),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::mission;

    fn errors(text: &str) -> WheelErrors {
        WheelErrors::of(&mission(text))
    }

    #[test]
    fn each_seed_has_wheels_of_its_own_within_the_spread_and_no_bias_is_common_to_all() {
        let robots = (1..=200)
            .map(|seed| errors(&format!("seed = {seed}\nsimulation.realism = 'measured'")));
        let robots: Vec<_> = robots.collect();
        type Value = fn(&WheelErrors) -> f64;
        let drawn: [(Value, f64); 3] = [
            (|robot| robot.diameter[1] / robot.diameter[0] - 1.0, 0.008),
            (|robot| robot.track - 1.0, 0.025),
            (|robot| robot.slip_share, 0.005),
        ];
        for (value, spread) in drawn {
            let mut off: Vec<_> = robots.iter().map(value).collect();
            off.sort_by(f64::total_cmp);
            for most in [-off[0], off[199]] {
                assert!((0.9 * spread..spread + 1e-12).contains(&most), "{most}");
            }
            let mean = off.iter().sum::<f64>() / 200.0;
            assert!(mean.abs() < 0.2 * spread, "{mean}");
        }
    }

    #[test]
    fn a_calibration_has_no_effect_on_the_wheels_of_the_simulated_robot() {
        let text = "seed = 7\nsimulation.realism = 'measured'";
        let calibrated =
            format!("{text}\n[robot.odometry]\ndiameter_ratio = 1.02\ntrack_scale = 0.9");
        assert_eq!(errors(text), errors(&calibrated));
    }
}
