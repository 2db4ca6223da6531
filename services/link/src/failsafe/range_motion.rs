//! Detection of sonar and infrared readings that contradict the wheels' motion.
//!
//! Each hypothesis places the hits of the last seconds by its own poses, and the monitor sums how
//! much nearer it brings hits of one surface. A sonar's surface may lie anywhere on its arc, so its
//! range is compared.
//!
//! At constant speed a lag shifts all hits alike. Only a turn, a change of speed, or its beginning
//! shows it. [`super::repeats`] finds a lag that begins.
//!
//! A sure verdict holds until the operator resumes.

use std::collections::{BTreeMap, VecDeque};

use common::{
    kinematics::Pose2,
    mission::{Mission, Sensor, SensorKind},
    samples::{DoubtsSample, RangeReading, RangeStatus},
};
use glam::DVec2;

use super::{
    motion_bank::{
        Bank,
        Hypothesis::{self, Late, Rolls},
        Poses, Row, motion_m, rolled,
    },
    repeats::Repeats,
};

/// Hypotheses with their limits: sums in metres for doubt and for certainty.
///
/// `firsthand-lab corpus` prints how often healthy missions reach certainty.
const ALL: [Row; 12] = [
    (Hypothesis::HEALTHY, [1.0, 1.0]),
    (Late(0.3), [1.0, 1.6]),
    (Late(0.5), [1.9, 3.0]),
    (Late(0.75), [2.0, 3.2]),
    (Late(1.0), [2.0, 3.2]),
    (Late(1.25), [2.0, 3.2]),
    (Late(1.5), [2.1, 3.4]),
    (Late(2.0), [2.2, 3.6]),
    (Rolls(0.5), [3.6, 5.5]),
    (Rolls(0.75), [1.9, 3.0]),
    (Rolls(1.33), [1.0, 1.6]),
    (Rolls(2.0), [1.9, 3.0]),
];
/// Share of the reach within which hits are reliable.
const KNOWN: f64 = 0.82;
/// Share of a sonar's field of view, to either side, that may hold its surface: its edge reaches
/// beyond the middle.
const HEARD: f64 = 2.0 / 3.0;
/// Least motion between readings, metres, and metres per radian of turn.
const MOVED_M: f64 = 0.004;
const M_PER_RAD: f64 = 0.1;
/// Least and most motion time between readings, seconds.
const APART_S: [f64; 2] = [0.1, 0.5];
/// Ages of compared hits, seconds of motion, and their number.
const LEAST_AGE_S: f64 = 0.7;
const MOST_AGE_S: f64 = 7.0;
const MOST_HITS: usize = 1024;
/// Metres: a hit beyond `NEW_M` is of a new surface, one delay must bring it within `NEAR_M`, and
/// delays must differ by `TELLS_M`.
const NEW_M: f64 = 0.2;
const NEAR_M: f64 = 0.1;
const TELLS_M: f64 = 0.03;
/// As in [`super::scan_motion`].
const FACTOR: f64 = 1.15;
const FADE_S: f64 = 12.0;

#[derive(Clone, Debug)]
struct Hit {
    /// Place under each delay.
    under: [DVec2; ALL.len()],
    /// Ends and quarters of the arc of a prompt reading.
    arc: [DVec2; 4],
}

#[derive(Clone, Debug)]
pub(super) struct RangeMotion {
    sensors: BTreeMap<u8, Sensor>,
    hits: VecDeque<(f64, Hit)>,
    /// Robot now under each hypothesis; the first is by the wheels.
    robots: [Pose2; ALL.len()],
    /// Robot at the newest hits, under each hypothesis.
    latest: [Pose2; ALL.len()],
    newest_s: f64,
    /// Time in motion, seconds.
    motion_s: f64,
    better: Bank<{ ALL.len() }>,
    repeats: Repeats,
}

impl RangeMotion {
    pub(super) fn of(mission: &Mission) -> Self {
        let is_single = |sensor: &Sensor| sensor.used && sensor.kind != SensorKind::Scan;
        let table = (0..).zip(mission.sensor_table());
        Self::with(table.filter(|(_, sensor)| is_single(sensor)).collect())
    }

    fn with(sensors: BTreeMap<u8, Sensor>) -> Self {
        Self {
            sensors,
            hits: VecDeque::new(),
            robots: [Pose2::default(); ALL.len()],
            latest: [Pose2::default(); ALL.len()],
            newest_s: 0.0,
            motion_s: 0.0,
            better: Bank::of(&ALL),
            repeats: Repeats::default(),
        }
    }

    pub(super) fn reset(&mut self) {
        *self = Self::with(std::mem::take(&mut self.sensors));
    }

    pub(super) fn take(&mut self, readings: &[RangeReading], poses: &Poses, at_s: f64) {
        if self.judged(true).is_some() {
            return;
        }
        let measured = || readings.iter().filter(|it| it.status() == RangeStatus::Measured);
        let judged = measured().filter(|it| self.sensors.contains_key(&it.sensor));
        self.repeats.take(judged.map(|it| (it.sensor, it.range_m)), poses, at_s);
        let counted = [self.robots[0], poses.at(at_s)];
        for (robot, (hypothesis, _)) in self.robots.iter_mut().zip(ALL) {
            *robot = match hypothesis {
                Late(by_s) => poses.at(at_s - by_s),
                Rolls(share) => rolled(*robot, counted, share),
                _ => counted[1],
            };
        }
        let robots = self.robots;
        let moved =
            std::array::from_fn(|it| motion_m([self.latest[it], robots[it]], M_PER_RAD) >= MOVED_M);
        // A clock may have been set back.
        let passed_s = (at_s - self.newest_s).abs().min(APART_S[1]);
        if passed_s < APART_S[0] || moved == [false; ALL.len()] {
            return;
        }
        self.latest = robots;
        self.newest_s = at_s;
        self.motion_s += passed_s;
        assert!((APART_S[0]..=APART_S[1]).contains(&passed_s));
        let now_s = self.motion_s;
        (0..ALL.len()).for_each(|it| self.better.fade(it, (-passed_s / FADE_S).exp()));
        let is_old = |(then_s, _): &(f64, Hit)| now_s - then_s > MOST_AGE_S;
        while self.hits.len() > MOST_HITS || self.hits.front().is_some_and(is_old) {
            self.hits.pop_front();
        }
        debug_assert!(self.hits.iter().is_sorted_by(|one, next| one.0 <= next.0));
        let older = self.hits.partition_point(|(then_s, _)| now_s - then_s >= LEAST_AGE_S);
        for reading in measured() {
            let Some(sensor) = self.sensors.get(&reading.sensor) else { continue };
            let range_m = reading.range_m;
            if range_m > KNOWN * sensor.reach_m {
                continue;
            }
            let from = robots.map(|robot| sensor.mount.on(robot));
            let under = from.map(|from| from.position + range_m * from.axis());
            let half_rad = sensor.field_of_view_deg.to_radians() / 2.0;
            let least_cos = (2.0 * HEARD * half_rad).cos();
            let off_m = |delay: usize, other: DVec2| {
                let way = other - from[delay].position;
                let axis = from[delay].axis();
                match sensor.kind {
                    SensorKind::Cone if way.dot(axis) < least_cos * way.length() => NEW_M,
                    SensorKind::Cone => (way.length() - range_m).abs(),
                    _ => under[delay].distance(other),
                }
            };
            let mut prompt_m = NEW_M;
            let mut least_m = [NEW_M; ALL.len()];
            for (_, other) in self.hits.range(..older) {
                for (delay, least_m) in least_m.iter_mut().enumerate() {
                    *least_m = least_m.min(off_m(delay, other.under[delay]));
                }
                let prompt = other.arc.iter().chain([&other.under[0]]);
                prompt_m = prompt.map(|place| off_m(0, *place)).fold(prompt_m, f64::min);
            }
            let [least, most] =
                [f64::min, f64::max].map(|of| least_m.into_iter().fold(least_m[0], of));
            if least < NEAR_M && most - least > TELLS_M {
                for hypothesis in (0..ALL.len()).filter(|it| moved[*it]) {
                    let better = prompt_m - FACTOR * least_m[hypothesis];
                    self.better.add(hypothesis, better, at_s);
                }
            }
            let at = |side: f64| DVec2::from_angle(from[0].heading + side * half_rad);
            let arc = [-1.0, -0.5, 0.5, 1.0].map(|side| from[0].position + range_m * at(side));
            self.hits.push_back((now_s, Hit { under, arc }));
        }
    }

    /// Returns how far the robot likely rolls, relative to what its wheels count, and since when.
    pub(super) fn rolls(&self) -> Option<(f64, f64)> {
        match self.better.likeliest(false)? {
            (Rolls(share), since_s) => Some((share, since_s)),
            _ => None,
        }
    }

    pub(super) fn doubt(&self, doubts: &mut DoubtsSample) {
        let is_late = |it| matches!(it, Late(_));
        doubts.late_ranges = self.better.doubt(is_late).max(self.repeats.doubt());
        doubts.miscounted = self.better.doubt(|it| !is_late(it));
    }

    pub(super) fn judged(&self, sure: bool) -> Option<String> {
        let whose = "sonars and infrared rangers";
        self.better.judged(sure, whose).or_else(|| self.repeats.judged(sure, whose))
    }
}

#[cfg(test)]
mod tests {
    use std::ops::Range;

    use super::*;
    use crate::testing::*;

    /// Returns the least range in a field of view to the post at (1, 0) or the wall at y = 0.7.
    fn range(sensor: &Sensor, robot: Pose2) -> Option<f64> {
        let (from, radius_m) = (sensor.mount.on(robot), 0.15);
        let seen = |range: &f64| (0.1..0.98 * sensor.reach_m).contains(range);
        let ranges = |share: f64| {
            let side = share * sensor.field_of_view_deg.to_radians() / 2.0;
            let axis = DVec2::from_angle(from.heading + side);
            let to = DVec2::X - from.position;
            let (along, beside) = (to.dot(axis), to.perp_dot(axis));
            let post = along - (radius_m * radius_m - beside * beside).sqrt();
            [post, (0.7 - from.position.y) / axis.y]
        };
        let all = (-5..=5).flat_map(|step| ranges(f64::from(step) / 5.0));
        all.filter(seen).reduce(f64::min)
    }

    /// Takes readings of these rows on a robot that drives to and fro before a post and turns.
    /// They are `late` ticks late in the ticks `during`, and else prompt.
    fn taken(rows: Range<u8>, late: usize, during: Range<u32>, ticks: u32) -> RangeMotion {
        let mission = mission("");
        let table = mission.sensor_table();
        let mut motion = RangeMotion::of(&mission);
        let mut by_wheels = Poses::default();
        let mut poses = vec![Pose2::default()];
        for tick in 0..ticks {
            let at_s = f64::from(tick) / 7.0;
            let pose = poses[poses.len() - 1]
                .along_arc(0.04 * (at_s * 0.9).cos(), 0.1 * (at_s * 0.7).cos());
            poses.push(pose);
            by_wheels.robot_is(pose, at(at_s));
            let late = if during.contains(&tick) { late } else { 0 };
            let then = poses[poses.len().saturating_sub(1 + late)];
            let readings = (0..)
                .zip(&table)
                .filter(|(sensor, _)| rows.contains(sensor))
                .filter_map(|(sensor, it)| Some(reading(sensor, Some(range(it, then)?))));
            motion.take(&Vec::from_iter(readings), &by_wheels, at_s);
        }
        motion
    }

    #[track_caller]
    fn names(said: &str, late: usize) {
        let words = said.split(' ').filter_map(|word| word.parse::<f64>().ok());
        let near = |delay_s: f64| (delay_s - late as f64 / 7.0).abs() < 0.3;
        assert!(words.map(near).eq([true]), "{said}");
    }

    #[test]
    fn late_readings_of_sonars_or_infrared_rangers_are_named_with_their_delay_until_resumed_and_prompt_ones_are_plausible()
     {
        for rows in [0..3, 3..10] {
            assert_eq!(taken(rows.clone(), 0, 0..280, 280).judged(true), None);
            for late in [7, 10] {
                names(&taken(rows.clone(), late, 0..140, 280).judged(true).unwrap(), late);
            }
        }
    }

    #[test]
    fn sonars_that_become_late_are_doubted_within_2_s() {
        assert_eq!(taken(0..3, 0, 70..84, 84).judged(false), None);
        names(&taken(0..3, 10, 70..84, 84).judged(false).unwrap(), 10);
    }
}
