//! A laser: each beam ends at the first thing that stands at its height.

use common::{
    kinematics::Pose2,
    mission::{Mission, Sensor},
};
use glam::DVec2;

use crate::{
    noise::{Noise, Source},
    world::World,
};

/// Beams that give no reading, of a thousand: the edges of things, and the sun. Nominal.
const LOST_OF_1000: f64 = 2.0;

/// The laser of a robot.
#[derive(Clone, Debug)]
pub(crate) struct Laser {
    sensor: Sensor,
    noise: Noise,
}

impl Laser {
    /// The laser of `mission`'s robot, whose noise follows from `seed`; none without one.
    pub(crate) fn new(mission: &Mission, seed: u64) -> Option<Self> {
        let (_, sensor) = mission.laser()?;
        Some(Self { sensor, noise: Noise::new(seed, Source::Laser) })
    }

    /// It measures once in so many ticks.
    pub(crate) const fn every_ticks(&self) -> u64 {
        self.sensor.every_ticks
    }

    /// The ranges of its beams on a robot at `pose`, metres: none for nothing in reach, less than 0 for no reading.
    pub(crate) fn scan(&mut self, world: &World, pose: Pose2) -> Vec<Option<f32>> {
        let mount = self.sensor.mount.on(pose);
        let height_m = world.heights().infrared_m;
        let (first, step) = self.sensor.fan();
        let (noise_m, noise_share) = self.sensor.model.beam_noise();
        let near = world.near(mount.position, self.sensor.reach_m, height_m);
        (0..self.sensor.beams)
            .map(|beam| {
                let along = DVec2::from_angle(mount.heading + first + step * beam as f64);
                let hit = near
                    .iter()
                    .filter_map(|surface| surface.hit(mount.position, along))
                    .min_by(f64::total_cmp);
                let lost = self.noise.chance(LOST_OF_1000 / 1000.0);
                let noise = self.noise.normal(1.0);
                let range = hit.map(|range| range + noise * (noise_m + noise_share * range));
                match range {
                    Some(range) if lost || range < self.sensor.model.least_m() => Some(-1.0),
                    Some(range) if range <= self.sensor.reach_m => Some(range as f32),
                    _ => None,
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn a_beam_ends_at_the_first_thing_in_reach_that_is_as_high_as_the_laser() {
        let mission = Mission::parse(
            "target = [0, -5]\nrobot.model = 'turtlebot3-waffle'\nworld.wall = [{ points = [[2, -1], [2, 1]] }]\nworld.drum = [{ at = [0, 2], radius_m = 0.5 }]\nworld.box = [{ at = [1, 0], size_m = [0.2, 0.2], top_m = 0.02 }]",
            Path::new("m.toml"),
        )
        .unwrap();
        let mut laser = Laser::new(&mission, 1).unwrap();
        let scan = laser.scan(&World::new(&mission), Pose2::default());
        assert_eq!(scan.len(), 360);
        // The first beam looks back; the laser is 64 mm behind the centre, its deviation 5 cm at 2 m.
        let at = |degrees: usize| scan[(degrees + 180) % 360];
        assert!((at(0).unwrap() - 2.064).abs() < 0.25, "{:?}", at(0));
        assert!((at(90).unwrap() - 1.5).abs() < 0.2, "{:?}", at(90));
        assert_eq!(at(180), None);
    }
}
