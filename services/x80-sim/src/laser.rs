//! Lasers and depth cameras.
//!
//! A laser's beam ends at the first surface at its height, and passes glass at a slant. A depth
//! camera's beam widens vertically and ends at the first thing that the body can touch.
//!
//! A beam that ends at a distant black surface returns no light and reads "nothing in reach".
//! Drivers publish it as infinity by ROS's REP 117 ("no return"), as does Slamtec's `rplidar_ros`.
//! A beam through glass with nothing behind reads the same.

use std::collections::VecDeque;

use common::{
    geometry::Light,
    json_wire::Scan,
    kinematics::Pose2,
    mission::{LaserTiming, Mission, Physics, Sensor},
};
use glam::DVec2;

use crate::{
    noise::{Noise, Source},
    world::{Solid, World},
};

/// Beams per 1000 without a reading, at edges and in the sun. Nominal.
const LOST_OF_1000: f64 = 2.0;

/// Maximum angle to a pane's normal for a reading. Nominal: reflections peak only for beams
/// perpendicular to the glass (L. Tibebu et al., "LiDAR-based glass detection for improved
/// occupancy grid mapping", Sensors 21(7), 2021).
const GLASS_LIMIT_DEG: f64 = 5.0;

const FASTEST_M_S: f64 = 5.0;

pub struct Laser {
    pub sensor: Sensor,
    height_m: f64,
    timing: LaserTiming,
    /// Recent poses by time in seconds, as far back as a scan goes.
    poses: VecDeque<(f64, Pose2)>,
    noise: Noise,
    /// This tick's scan, or empty. Metres: `None` for nothing in reach, negative for no reading.
    scan: Vec<Option<f32>>,
}

impl Laser {
    /// Creates the lasers whose scans come with the robot's frames.
    pub fn all(mission: &Mission, seed: u64) -> Vec<Self> {
        let (lasers, physics) = (mission.lasers_of_base(), mission.simulation.physics());
        let laser = |(nth, (_, sensor))| Self::new(sensor, &physics, (seed, nth));
        lasers.into_iter().enumerate().map(laser).collect()
    }

    /// Creates a laser that sends each measurement itself, up to a tick late.
    pub fn with_own_wire(sensor: Sensor, mission: &Mission, seed: u64) -> Self {
        let mut physics = mission.simulation.physics();
        physics.laser.delay_s = 0.0;
        physics.laser.sweep_s = 1.0 / mission.robot.rate_hz;
        Self::new(sensor, &physics, (seed, 0))
    }

    fn new(sensor: Sensor, physics: &Physics, (seed, nth): (u64, usize)) -> Self {
        assert!(sensor.every_ticks > 0);
        let noise = Noise::of_nth(seed, Source::Laser, nth);
        let height_m = sensor.height_m.unwrap_or(physics.heights.infrared_m);
        let timing = physics.laser;
        Self { sensor, height_m, timing, poses: VecDeque::new(), noise, scan: Vec::new() }
    }

    pub fn measure(&mut self, world: &World, pose: Pose2, (tick, time): (u64, f64)) {
        self.scan = match tick.is_multiple_of(self.sensor.every_ticks) {
            true => self.scan(world, pose, time),
            false => Vec::new(),
        };
    }

    pub fn said(&self) -> Option<Scan> {
        let LaserTiming { delay_s, sweep_s, stated_share } = self.timing;
        let stated = [delay_s + sweep_s, sweep_s].map(|seconds| stated_share * seconds);
        let [age_s, time_s] = stated.map(|seconds| (stated[0] > 0.0).then_some(seconds));
        (!self.scan.is_empty()).then(|| Scan { ranges: self.scan.clone(), age_s, time_s })
    }

    pub fn follow(&mut self, time: f64, pose: Pose2) {
        let oldest = time - self.timing.delay_s - self.timing.sweep_s;
        while self.poses.get(1).is_some_and(|(at, _)| *at <= oldest) {
            self.poses.pop_front();
        }
        self.poses.push_back((time, pose));
    }

    fn pose_of_beam(&self, time: f64, beam: usize) -> Option<Pose2> {
        let LaserTiming { delay_s, sweep_s, .. } = self.timing;
        let left = 1.0 - self.sensor.mirrored(beam) as f64 / self.sensor.beams.max(1) as f64;
        self.pose_at(time - delay_s - sweep_s * left)
    }

    fn pose_at(&self, time: f64) -> Option<Pose2> {
        let later = self.poses.partition_point(|(noted, _)| *noted < time);
        Some(self.poses.get(later).or(self.poses.back())?.1)
    }

    pub fn near(&self, world: &World, pose: Pose2) -> Vec<Solid> {
        let position = self.sensor.mount.on(pose).position;
        let reach_m = self.sensor.reach_m + self.went_m();
        world.near(position, reach_m, self.height_m, self.sensor.model.rise())
    }

    fn went_m(&self) -> f64 {
        (self.timing.delay_s + self.timing.sweep_s) * FASTEST_M_S
    }

    pub fn scan(&mut self, world: &World, pose: Pose2, time: f64) -> Vec<Option<f32>> {
        let mount = self.sensor.mount.on(pose);
        let (first, step) = self.sensor.fan();
        let near = self.near(world, pose);
        let is_prompt = self.went_m() == 0.0;
        let mut beams: Vec<_> = (0..self.sensor.beams)
            .map(|beam| {
                let taken_at = if is_prompt { None } else { self.pose_of_beam(time, beam) };
                let mount = taken_at.map_or(mount, |pose| self.sensor.mount.on(pose));
                self.reading(&near, mount.position, mount.heading + first + step * beam as f64)
            })
            .collect();
        self.sensor.mirror(&mut beams);
        beams
    }

    /// Returns a beam's reading at an angle clockwise from the laser's front, radians.
    pub fn clockwise(&mut self, near: &[Solid], time: f64, angle: f64) -> Option<f32> {
        let mount = self.sensor.mount.on(self.pose_at(time)?);
        let angle = if self.sensor.is_upside_down { angle } else { -angle };
        self.reading(near, mount.position, mount.heading + angle)
    }

    fn reading(&mut self, near: &[Solid], from: DVec2, heading: f64) -> Option<f32> {
        let (noise_m, noise_share) = self.sensor.model.product().noise;
        let black_reach_m = self.sensor.model.black_reach_m();
        let along = DVec2::from_angle(heading);
        let rise = self.sensor.model.rise();
        let is_in_beam =
            |solid: &Solid, range: f64| solid.profile.height_gap(self.height_m) <= rise * range;
        let hit = near
            .iter()
            .filter_map(|solid| {
                end(solid, from, along).filter(|(range, _)| is_in_beam(solid, *range))
            })
            .min_by(|(a, _), (b, _)| a.total_cmp(b))
            .filter(|&(range, light)| light != Light::Black || range <= black_reach_m);
        let lost = self.noise.chance(LOST_OF_1000 / 1000.0);
        let noise = self.noise.normal(1.0);
        let range = hit.map(|(range, _)| range + noise * (noise_m + noise_share * range));
        match range {
            Some(range) if lost || range < self.sensor.model.product().least_m => Some(-1.0),
            Some(range) if range <= self.sensor.reach_m => Some(range as f32),
            _ => None,
        }
    }
}

/// Returns the range at which a beam ends at `solid`, metres, and the solid's effect on light;
/// `None` if it passes.
fn end(solid: &Solid, origin: DVec2, along: DVec2) -> Option<(f64, Light)> {
    let (range, light) = (solid.surface.hit(origin, along)?, solid.profile.light);
    let is_slanted = || {
        let cos = solid.surface.incidence_cos(origin + along * range, along);
        cos < GLASS_LIMIT_DEG.to_radians().cos()
    };
    (light != Light::Glass || !is_slanted()).then_some((range, light))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{mission, near};

    fn scan(laser: &mut Laser, mission: &Mission) -> Vec<Option<f64>> {
        let scan = laser.scan(&World::new(mission), Pose2::default(), 0.0);
        scan.into_iter().map(|range| range.map(f64::from)).collect()
    }

    /// Returns the scan of the mission's first laser at the origin.
    fn seen(text: &str) -> Vec<Option<f64>> {
        let mission = mission(text);
        scan(&mut Laser::all(&mission, 1)[0], &mission)
    }

    #[test]
    fn a_laser_that_is_turned_and_off_the_centre_measures_from_where_it_is_and_its_middle_beam_looks_where_it_is_turned()
     {
        let scan = seen(
            "robot.model = 'turtlebot4'\nworld.wall = [{ points = [[-2, 1], [2, 1]] }, { points = [[2, -2], [2, 2]] }]\n",
        );
        // The middle beam looks left. The laser is 40 mm behind the centre; its deviation is 1.5 cm
        // at 2 m.
        for (degrees, want, most) in
            [(90, 1.0, 0.05), (0, 2.04, 0.08), (135, 1.0 / 0.5_f64.sqrt(), 0.07)]
        {
            is_near(scan[(degrees + 180 + 270) % 360], want, most);
        }
    }

    #[test]
    fn a_laser_upside_down_gives_the_beams_of_an_upright_one_in_the_other_order() {
        let scan = |roll_deg: i32| {
            seen(&format!(
                "robot.protocol = 'json'\nworld.wall = [{{ points = [[-2, 1], [2, 1]] }}]\n[[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nforward_m = 0\nbearing_deg = 0\nroll_deg = {roll_deg}\n"
            ))
        };
        let mut turned = scan(180);
        assert!(turned[180].is_some() && turned[900].is_none());
        turned.reverse();
        assert_eq!(turned, scan(0));
    }

    #[test]
    fn each_of_several_lasers_measures_from_its_own_place_and_height_with_noise_of_its_own() {
        let row = |name: &str, keys: &str| {
            format!(
                "[[robot.sensor]]\nname = '{name}'\nkind = 'scan'\nforward_m = 0.2\nbeams = 3\n{keys}\n"
            )
        };
        let mission = mission(&format!(
            "robot.protocol = 'json'\nworld.wall = [{{ points = [[2, -9], [2, 9]] }}, {{ points = [[-1, -9], [-1, 9]] }}]\nworld.box = [{{ at = [1, 0], size_m = [0.2, 2], top_m = 0.12 }}]\n{}{}{}",
            row("low", "bearing_deg = 0\nheight_m = 0.05"),
            row("high", "bearing_deg = 0"),
            row("back", "bearing_deg = 180")
        ));
        let world = World::new(&mission);
        let ahead = |laser: &mut Laser| {
            laser.measure(&world, Pose2::default(), (0, 0.0));
            f64::from(laser.said().unwrap().ranges[1].unwrap())
        };
        let ranges: Vec<_> = Laser::all(&mission, 1).iter_mut().map(ahead).collect();
        let true_m = [0.7, 1.8, 0.8];
        assert!(ranges.iter().zip(true_m).all(|(it, is)| (it - is).abs() < 0.1), "{ranges:?}");
        assert_ne!(ranges[0] - 0.7, ranges[1] - 1.8);
    }

    #[test]
    fn a_late_laser_that_turns_measures_each_beam_from_where_the_robot_was_then() {
        let mission = mission(
            "robot.model = 'kobuki'\nworld.wall = [{ points = [[5, -9], [5, 9]] }]\n\
            simulation.laser = { delay_s = 0.2, sweep_s = 0.1 }\n",
        );
        let mut laser = Laser::all(&mission, 1).remove(0);
        let at = |time: f64| Pose2 { position: DVec2::new(time, 0.0), heading: 0.0 };
        (0..=300).map(|step| f64::from(step) / 100.0).for_each(|s| laser.follow(s, at(s)));
        let scan = laser.scan(&World::new(&mission), at(3.0), 3.0);
        // Beam 180 of 360 looks ahead: it was measured 0.25 s before, from 64 mm behind the centre.
        is_near(scan[180].map(f64::from), 5.0 - 2.75 + 0.064, 0.15);
        assert!(laser.poses.len() < 40);
        laser.measure(&World::new(&mission), at(3.0), (0, 3.0));
        let Scan { age_s: Some(age_s), time_s: Some(time_s), .. } = laser.said().unwrap() else {
            panic!("no times");
        };
        assert!((age_s - 0.3).abs() < 1e-9 && time_s == 0.1);
    }

    #[test]
    fn a_depth_camera_sees_what_is_low_or_hangs_and_is_touched_from_where_its_picture_shows_it_and_nothing_near()
     {
        let ahead = |x: f64, heights: &str| {
            let mission = mission(&format!(
                "robot.model = 'turtlebot2'\nworld.box = [{{ at = [{}, 0], size_m = [0.2, 2], {heights} }}]",
                x + 0.2
            ));
            scan(&mut Laser::all(&mission, 1)[1], &mission)[87]
        };
        // The camera is 0.1 m ahead of the robot's centre; the face is as far ahead of the box's.
        is_near(ahead(1.0, "top_m = 0.05"), 1.0, 0.1);
        is_near(ahead(1.0, "bottom_m = 0.24"), 1.0, 0.1);
        // A sill is not touched.
        assert_eq!(ahead(1.0, "top_m = 0.02"), None);
        // A table top is not touched.
        assert_eq!(ahead(1.0, "bottom_m = 0.3"), None);
        // Nearer than 0.3 m it reads nothing.
        assert_eq!(ahead(0.2, "top_m = 0.25"), Some(-1.0));
        // Too far away.
        assert_eq!(ahead(3.5, "top_m = 0.25"), None);
    }

    #[track_caller]
    fn is_near(range: Option<f64>, want: f64, most: f64) {
        near(range.unwrap(), want, most);
    }

    #[test]
    fn glass_is_measured_square_on_and_at_a_slant_what_stands_behind_it_and_black_from_near() {
        let wall = |x: f64, light: &str| format!("{{ points = [[{x}, -9], [{x}, 9]]{light} }}");
        let pane = wall(2.0, ", light = 'glass'");
        let black = |x: f64| {
            format!("world.wall = [{}, {}]", wall(x, ", light = 'black'"), wall(x + 1.0, ""))
        };
        let before_wall = format!("world.wall = [{pane}, {}]", wall(4.0, ""));
        let column = "world.drum = [{ at = [2, 0], radius_m = 0.5, light = 'glass' }]";
        for (shapes, seen_m) in [
            (
                &before_wall,
                &[(0, Some(2.0)), (4, Some(2.0)), (6, Some(4.02)), (30, Some(4.62))][..],
            ),
            (&format!("world.wall = [{pane}]"), &[(30, None)]),
            (&column.to_owned(), &[(0, Some(1.5)), (8, None)]),
            (&black(3.8), &[(0, Some(3.8))]),
            (&black(4.2), &[(0, None)]),
        ] {
            // A UST-10LX on a Jackal; its middle beam is 540, and 4 beams are a degree.
            let mission = mission(&format!("robot.model = 'jackal'\n{shapes}"));
            let mut laser = Laser::all(&mission, 1).remove(0);
            let position = DVec2::new(-laser.sensor.mount.forward_m, 0.0);
            let pose = Pose2 { position, heading: 0.0 };
            let scan = laser.scan(&World::new(&mission), pose, 0.0);
            for &(degrees, want) in seen_m {
                let range = scan[540 + degrees * 4].map(f64::from);
                let off = range.unwrap_or(99.0) - want.unwrap_or(99.0);
                assert!(off.abs() < 0.1, "{shapes} {degrees}: {range:?}");
            }
        }
    }
}
