//! Check that a laser's scans change as the robot moves.
//!
//! Each scan is predicted from one half a second earlier by the wheels' motion: for prompt scans,
//! for several delays, and for no motion. The monitor sums how much better another prediction fits
//! than the prompt one, while they differ. At rest or in a long straight corridor they agree, and
//! nothing changes.

use std::collections::VecDeque;

use common::{driver::LaserScan, kinematics::Pose2, mission::Sensor, samples::DoubtsSample};
use glam::DVec2;

use super::{
    motion_bank::{
        Bank,
        Hypothesis::{self, Late, Longer, Rolls, Scaled},
        MOST_KEPT, Poses, Row,
    },
    repeats::Repeats,
};

/// Hypotheses with their limits: sums in metre-seconds for doubt and for certainty.
///
/// `firsthand-lab corpus` prints how often healthy missions reach certainty.
const ALL: [Row; 16] = [
    (Hypothesis::HEALTHY, LIMITS),
    (Late(0.3), LIMITS),
    (Late(0.5), LIMITS),
    (Late(0.75), LIMITS),
    (Late(1.0), LIMITS),
    (Late(1.25), LIMITS),
    (Late(1.5), LIMITS),
    (Late(1.75), LIMITS),
    (Late(2.0), LIMITS),
    (Rolls(0.0), [0.035, 0.06]),
    (Scaled(0.5), LIMITS),
    (Scaled(2.0), LIMITS),
    (Longer(-0.8), LIMITS),
    (Longer(-0.3), LIMITS),
    (Longer(0.3), LIMITS),
    (Longer(0.8), LIMITS),
];
const LIMITS: [f64; 2] = [0.045, 0.08];
const APART_S: f64 = 0.45;
const MOST_APART_S: f64 = 1.0;
const BEAMS: usize = 180;
/// Beams whose repetitions are judged.
const REPEATING: usize = 12;
const LEAST_BEAMS: f64 = 20.0;
/// Largest difference of one surface, metres.
const MOST_M: f64 = 0.3;
/// Mean difference of a prediction that fits, metres. On logs of real robots, healthy ones reach it
/// while the wheels slip.
const FITS_M: f64 = 0.15;
/// Time constant of the sums, in seconds of distinct predictions.
const FADE_S: f64 = 4.0;
/// Least difference that tells a hypothesis from a healthy robot, metres.
const TELLS_M: f64 = 0.005;
/// Factor by which a hypothesis must fit better.
const FACTOR: f64 = 1.2;

#[derive(Clone, Debug)]
pub(super) struct ScanMotion {
    pub row: usize,
    sensor: Sensor,
    /// Recent scans. The newest is judged once later poses are known.
    scans: VecDeque<(f64, Vec<f32>)>,
    better: Bank<{ ALL.len() }>,
    repeats: Repeats,
}

impl ScanMotion {
    pub(super) fn new(row: usize, sensor: Sensor) -> Self {
        let (better, repeats) = (Bank::of(&ALL), Repeats::default());
        Self { row, sensor, scans: VecDeque::new(), better, repeats }
    }

    pub(super) fn reset(&mut self) {
        *self = Self::new(self.row, self.sensor.clone());
    }

    pub(super) fn take(&mut self, scan: &LaserScan, poses: &Poses, at_s: f64) {
        if poses.is_empty() || scan.beams.len() != self.sensor.beams {
            return;
        }
        let some = scan.beams.iter().step_by((scan.beams.len() / REPEATING).max(1));
        let ranges = (0..).zip(some.map(|range| f64::from(*range)));
        self.repeats.take(ranges.filter(|(_, range)| range.is_finite()), poses, at_s);
        if let Some((newest_s, newest)) = self.scans.back()
            && let Some((first_s, first)) = self.scans.front()
            && (APART_S..=MOST_APART_S).contains(&(newest_s - first_s))
        {
            let unlike = ALL.map(|(hypothesis, _)| {
                let [from, to] = hypothesis.robots(poses, [*first_s, *newest_s]);
                self.unlike(hypothesis, (first, from), (newest, to))
            });
            let for_s = (at_s - newest_s).clamp(0.0, APART_S);
            for (it, (hypothesis, _)) in ALL.iter().enumerate() {
                // A short delay is healthy.
                let healthy = match hypothesis {
                    Late(_) => unlike[0],
                    _ => unlike[0].min(unlike[1]),
                };
                // NaN, from too few beams, tells nothing.
                if (unlike[it] - healthy).abs() >= TELLS_M {
                    // Where neither fits, as while wheels slip, neither gains.
                    let fits = (-(healthy.min(unlike[it]) / FITS_M).powi(2)).exp();
                    let gained = fits * (healthy - FACTOR * unlike[it]) * for_s;
                    self.better.fade(it, (-for_s / FADE_S).exp());
                    self.better.add(it, gained, at_s);
                }
            }
        }
        self.scans.push_back((at_s, scan.beams.clone()));
        // A clock may have been set back.
        let old = |next_s: f64| next_s <= at_s - APART_S || next_s > at_s;
        while self.scans.len() > MOST_KEPT || self.scans.get(1).is_some_and(|next| old(next.0)) {
            self.scans.pop_front();
        }
    }

    fn unlike(
        &self,
        hypothesis: Hypothesis,
        (first, from): (&[f32], Pose2),
        (second, to): (&[f32], Pose2),
    ) -> f64 {
        let [from, to] = [from, to].map(|robot| self.sensor.mount.on(robot));
        let (first_rad, step_rad) = self.sensor.fan();
        assert!(step_rad > 0.0);
        let axis = from.axis();
        let differences = second.iter().enumerate().step_by((second.len() / BEAMS).max(1));
        let differences = differences.filter_map(|(beam, range)| {
            let distance = hypothesis.distance(f64::from(*range));
            let bearing = to.heading + first_rad + beam as f64 * step_rad;
            let point = to.position + distance * DVec2::from_angle(bearing) - from.position;
            let bearing = axis.perp_dot(point).atan2(axis.dot(point));
            let seen = first.get(((bearing - first_rad) / step_rad).round() as usize)?;
            let difference = (hypothesis.range(point.length()) - f64::from(*seen)).abs();
            difference.is_finite().then_some(difference.min(MOST_M))
        });
        let (sum, beams) = differences.fold((0.0, 0.0), |(sum, beams), it| (sum + it, beams + 1.0));
        if beams < LEAST_BEAMS { f64::NAN } else { sum / beams }
    }

    pub(super) fn doubt(&self, doubts: &mut DoubtsSample) {
        let is_late = |it| matches!(it, Late(_));
        let late = self.better.doubt(is_late).max(self.repeats.doubt());
        doubts.late_scans = doubts.late_scans.max(late);
        doubts.frozen_scans = doubts.frozen_scans.max(self.better.doubt(|it| it == Rolls(0.0)));
        let is_scaled = |it| matches!(it, Scaled(_) | Longer(_));
        doubts.scaled_scans = doubts.scaled_scans.max(self.better.doubt(is_scaled));
    }

    pub(super) fn judged(&self, sure: bool) -> Option<String> {
        let name = &self.sensor.name;
        self.better.judged(sure, name).or_else(|| self.repeats.judged(sure, name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::*;

    /// Returns the range to the walls at x = 3 and -3 and at y = 2 and -2.
    fn range(from: DVec2, bearing: f64) -> f64 {
        let axis = DVec2::from_angle(bearing);
        ((DVec2::new(3.0, 2.0) * axis.signum() - from) / axis).min_element()
    }

    /// Judges 10 Hz scans for 6 s of alternate driving and turning; `seen` maps the present index
    /// to the scan sent. The robot drives `share` of what the wheels do.
    fn said(speed_m_s: f64, share: f64, seen: impl Fn(usize) -> usize) -> Option<String> {
        let mission = mission("robot.model = 'kobuki'\nrobot.protocol = 'json'");
        let (row, sensor) = mission.laser().unwrap();
        let (first_rad, step_rad) = sensor.fan();
        let (mut motion, mut poses) = (ScanMotion::new(row, sensor.clone()), Poses::default());
        let (mut pose, mut wheels, mut scans) = (Pose2::default(), Pose2::default(), Vec::new());
        for tick in 0..60 {
            let turn = if tick % 40 < 20 { 0.0 } else { 0.08 };
            pose = pose.along_arc(share * 0.1 * speed_m_s, turn);
            wheels = wheels.along_arc(0.1 * speed_m_s, turn);
            let laser = sensor.mount.on(pose);
            let beam = |beam: usize| {
                // Noise of 1 % that never repeats.
                let noise = 1.0 + 0.01 * ((tick * tick + beam) as f64).sin();
                let bearing = laser.heading + first_rad + beam as f64 * step_rad;
                (noise * range(laser.position, bearing)) as f32
            };
            scans.push(Vec::from_iter((0..sensor.beams).map(beam)));
            let at_s = tick as f64 * 0.1;
            poses.robot_is(wheels, at(at_s));
            let beams = scans[seen(tick)].clone();
            motion.take(&LaserScan { row, beams, ..LaserScan::default() }, &poses, at_s);
        }
        motion.judged(true)
    }

    #[test]
    fn scans_that_are_late_or_frozen_are_named_with_their_delay_and_prompt_ones_are_plausible() {
        for speed_m_s in [0.1, 0.4] {
            assert_eq!(said(speed_m_s, 1.0, |tick| tick), None);
            for (late, delay) in [(5, "0.5"), (10, "1.0"), (20, "2.0")] {
                let said = said(speed_m_s, 1.0, |tick| tick.saturating_sub(late)).unwrap();
                assert!(said.contains(&format!("they are {delay} s later")), "{said}");
            }
            let said = said(speed_m_s, 1.0, |tick| tick.min(10)).unwrap();
            assert!(said.contains("do not change although the wheels turn"), "{said}");
        }
        assert_eq!(said(0.0, 1.0, |tick| tick), None);
    }

    #[test]
    fn scans_of_a_robot_that_slides_otherwise_than_its_wheels_turn_are_neither_late_nor_frozen() {
        for share in [-1.5, -1.0, 2.5] {
            assert_eq!(said(0.4, share, |tick| tick), None, "{share}");
        }
    }
}
