//! Whether the readings of infrared rangers are as old as they say.
//!
//! Late readings are placed where the robot is, and not where it was. At a constant speed and turn that moves all they show alike, but
//! what is seen again after the robot has turned or slowed then lies beside itself. So each ranger's hit is compared with the hits of the
//! last seconds, as if all were prompt and as if all were later by a number of delays: by how much it lies nearer to them with another delay
//! is summed up. A sonar's hit may lie anywhere on its arc, so it is compared with, and not judged.
//!
//! In 175 recorded missions with moving things, slip and noise no sum was more than 2.2, and 1.3 but for robots that began in a corridor or
//! went on for minutes. Of 14 with readings 1 s late 11 were above 2.8.

use std::collections::VecDeque;

use common::{
    mission::{Mission, Sensor, SensorKind},
    samples::{RangeReading, RangeStatus},
};
use glam::DVec2;

use super::scan_motion::Poses;

const DELAYS_S: [f64; 7] = [0.0, 0.3, 0.5, 0.75, 1.0, 1.25, 1.5];
/// Shares of a ranger's and a sonar's reach up to which a hit is well known.
const KNOWN: [f64; 2] = [0.82, 0.47];
/// Hits are compared with those between these ages, seconds, and no more than so many.
const LEAST_AGE_S: f64 = 0.7;
const MOST_AGE_S: f64 = 12.0;
const MOST_HITS: usize = 1024;
/// A hit farther from others is of something new, metres. One delay must bring it near, and the delays must differ by so much.
const NEW_M: f64 = 0.25;
const NEAR_M: f64 = 0.1;
const TELLS_M: f64 = 0.03;
/// As for scans: [`super::scan_motion`].
const FACTOR: f64 = 1.15;
const FADE_S: f64 = 12.0;
const BETTER: [f64; 2] = [1.5, 2.8];

type Hit = [DVec2; DELAYS_S.len()];

#[derive(Clone, Debug)]
pub(super) struct RangeMotion {
    sensors: Vec<(u8, Sensor)>,
    pub(super) poses: Poses,
    hits: VecDeque<(f64, Hit)>,
    newest_s: f64,
    better: [f64; DELAYS_S.len()],
}

impl RangeMotion {
    pub(super) fn of(mission: &Mission) -> Self {
        let is_single = |sensor: &Sensor| sensor.used && sensor.kind != SensorKind::Scan;
        let table = (0..).zip(mission.sensor_table());
        Self::new(table.filter(|(_, sensor)| is_single(sensor)).collect())
    }

    fn new(sensors: Vec<(u8, Sensor)>) -> Self {
        let (poses, hits, better) = Default::default();
        Self { sensors, poses, hits, newest_s: 0.0, better }
    }

    pub(super) fn reset(&mut self) {
        *self = Self::new(std::mem::take(&mut self.sensors));
    }

    pub(super) fn take(&mut self, readings: &[RangeReading], at_s: f64) {
        let robots = DELAYS_S.map(|delay_s| self.poses.at(at_s - delay_s));
        let fades = (-(at_s - self.newest_s).max(0.0) / FADE_S).exp();
        self.better = self.better.map(|better| better * fades);
        self.newest_s = at_s;
        let forgets = |(then, _): &(f64, Hit)| !(0.0..MOST_AGE_S).contains(&(at_s - then));
        while self.hits.len() > MOST_HITS || self.hits.front().is_some_and(forgets) {
            self.hits.pop_front();
        }
        let older = self.hits.partition_point(|(then, _)| at_s - then >= LEAST_AGE_S);
        for reading in readings.iter().filter(|it| it.status() == RangeStatus::Measured) {
            let is_row = |sensor: &&(u8, Sensor)| sensor.0 == reading.sensor;
            let Some((_, sensor)) = self.sensors.iter().find(is_row) else { continue };
            let is_ray = sensor.kind == SensorKind::Ray;
            if reading.range_m > KNOWN[usize::from(!is_ray)] * sensor.reach_m {
                continue;
            }
            let hit = robots.map(|robot| sensor.mount.hit(robot, reading.range_m));
            if is_ray {
                let mut off_m = [NEW_M; DELAYS_S.len()];
                for (_, other) in self.hits.range(..older) {
                    for (delay, off_m) in off_m.iter_mut().enumerate() {
                        *off_m = off_m.min(hit[delay].distance(other[delay]));
                    }
                }
                let [least, most] =
                    [f64::min, f64::max].map(|of| off_m[1..].iter().copied().fold(off_m[0], of));
                if least < NEAR_M && most - least > TELLS_M {
                    for (sum, other) in self.better.iter_mut().zip(off_m) {
                        *sum = (*sum + off_m[0] - FACTOR * other).max(0.0);
                    }
                }
            }
            self.hits.push_back((at_s, hit));
        }
    }

    /// The explanation by the delay that is best, if readings are doubted, or surely late.
    pub(super) fn judged(&self, sure: bool) -> Option<String> {
        let better = DELAYS_S.into_iter().zip(self.better);
        let (likely_s, better) = better.max_by(|(_, one), (_, other)| one.total_cmp(other))?;
        (better > BETTER[usize::from(sure)]).then(|| format!(
            "what the infrared rangers see fits together if they are {likely_s} s later than they say: look for what holds their readings back, then `firsthand stop` and `resume`"
        ))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use common::{clock::MissionTime, kinematics::Pose2};

    use super::*;

    /// The range of a ray to the post at (1, 0) or to a wall at y = 0.7.
    fn range(from: DVec2, axis: DVec2) -> Option<f64> {
        let (to, radius_m) = (DVec2::X - from, 0.15);
        let (along, beside) = (to.dot(axis), to.perp_dot(axis));
        let post = along - (radius_m * radius_m - beside * beside).sqrt();
        let wall = (0.7 - from.y) / axis.y;
        let seen = |range: &f64| (0.1..0.8).contains(range);
        [post, wall].into_iter().filter(seen).reduce(f64::min)
    }

    /// What is said of readings that are so late, from a robot that drives to and fro before a post and turns meanwhile.
    fn said(late: usize) -> Option<String> {
        let mission = Mission::parse("target = [3, 0]", Path::new("test.toml")).unwrap();
        let table = mission.sensor_table();
        let mut motion = RangeMotion::of(&mission);
        let mut poses = vec![Pose2::default()];
        for tick in 0..140 {
            let at_s = f64::from(tick) / 7.0;
            let pose = poses[poses.len() - 1]
                .along_arc(0.04 * (at_s * 0.9).cos(), 0.1 * (at_s * 0.7).cos());
            poses.push(pose);
            motion.poses.robot_is(pose, MissionTime::from_seconds(at_s));
            let then = poses[poses.len().saturating_sub(1 + late)];
            let readings: Vec<_> = (0..)
                .zip(&table)
                .skip(3)
                .filter_map(|(sensor, it)| {
                    let mount = it.mount.on(then);
                    let range_m = range(mount.position, mount.axis())?;
                    let status = RangeStatus::Measured.into();
                    Some(RangeReading { range_m, sensor, raw: 0, status })
                })
                .collect();
            motion.take(&readings, at_s);
            if let Some(said) = motion.judged(true) {
                return Some(said);
            }
        }
        None
    }

    #[test]
    fn readings_of_infrared_rangers_that_are_late_are_named_with_their_delay_and_prompt_ones_are_plausible()
     {
        assert_eq!(said(0), None);
        for (late, delay) in [(7, "1 s"), (10, "1.5 s")] {
            let said = said(late).unwrap();
            assert!(said.contains(&format!("if they are {delay} later")), "{said}");
        }
    }
}
