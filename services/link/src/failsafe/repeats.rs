//! Detection of readings that repeat earlier ones of their sensor.
//!
//! A delay that begins cannot show what is yet to come: readings pause, or those of a while ago come
//! again. Sensors of a moving robot repeat their readings by chance, but not all with the same lag,
//! unless the robot is where it was that time ago. Each lag has a sum of log-likelihood ratios, as in
//! Page's test.

use std::collections::{BTreeMap, VecDeque};

use super::{
    keep,
    motion_bank::{Hypothesis, Poses, motion_m},
};

/// Least change from one reading to the next that shows motion, and tolerance of a repeated one,
/// metres.
const CHANGES_M: f64 = 0.012;
const SAME_M: f64 = 0.005;
/// Least motion during a lag, metres, and metres per radian of turn.
const MOVED_M: f64 = 0.03;
const M_PER_RAD: f64 = 0.3;
/// Steps of lags, seconds, the least one, and their number. A repetition counts for the two nearest.
const STEP_S: f64 = 0.15;
const LEAST_S: f64 = 0.25;
const LAGS: usize = 18;
/// Bound on kept readings of a sensor.
const MOST_KEPT: usize = 128;
/// Share of readings that repeat with the lag of a delay.
const REPEATED: f64 = 0.95;
/// Sums for doubt and for certainty.
const LIMITS: [f64; 2] = [8.0, 14.0];

#[derive(Clone, Debug, Default)]
pub(super) struct Repeats {
    /// Times and ranges, seconds and metres, by sensor.
    past: BTreeMap<u8, VecDeque<(f64, f64)>>,
    sums: [f64; LAGS],
}

impl Repeats {
    /// Takes sensors with their ranges, metres, and poses by the wheels.
    pub(super) fn take(
        &mut self,
        readings: impl Iterator<Item = (u8, f64)>,
        poses: &Poses,
        at_s: f64,
    ) {
        let now = poses.at(at_s);
        let has_moved: [bool; LAGS] = std::array::from_fn(|lag| {
            motion_m([poses.at(at_s - lag as f64 * STEP_S), now], M_PER_RAD) > MOVED_M
        });
        for (sensor, range_m) in readings {
            let past = self.past.entry(sensor).or_default();
            // Frames that come at once waited somewhere. Their times are unknown, and the last is
            // now's.
            if let Some((then_s, before_m)) = past.back_mut()
                && (0.0..STEP_S / 2.0).contains(&(at_s - *then_s))
            {
                *before_m = range_m;
                continue;
            }
            if past.back().is_some_and(|(_, before_m)| (range_m - before_m).abs() > CHANGES_M) {
                let mut repeats = [false; LAGS];
                let same = past.iter().filter(|(_, then_m)| (range_m - then_m).abs() < SAME_M);
                let lags = same.map(|(then_s, _)| at_s - then_s).filter(|lag_s| *lag_s >= LEAST_S);
                for lag in lags.map(|lag_s| (lag_s / STEP_S) as usize) {
                    repeats.iter_mut().skip(lag).take(2).for_each(|it| *it = true);
                }
                // Chance to repeat with any lag.
                let count = repeats.iter().filter(|it| **it).count();
                let chance = (count as f64 / LAGS as f64).min(REPEATED);
                let sums = self.sums.iter_mut().zip(repeats).zip(has_moved);
                for ((sum, repeats), _) in sums.filter(|(_, has_moved)| *has_moved) {
                    let ratio =
                        if repeats { REPEATED / chance } else { (1.0 - REPEATED) / (1.0 - chance) };
                    *sum = (*sum + ratio.ln()).clamp(0.0, 2.0 * LIMITS[1]);
                }
            }
            keep(past, (at_s, range_m), LAGS as f64 * STEP_S, MOST_KEPT);
        }
    }

    pub(super) fn judged(&self, sure: bool, whose: &str) -> Option<String> {
        let lags = self.sums.iter().zip(0_u8..);
        let (sum, lag) = lags.max_by(|one, other| one.0.total_cmp(other.0))?;
        let words = || Hypothesis::Late(f64::from(lag) * STEP_S).words(whose);
        (*sum >= LIMITS[usize::from(sure)]).then(words)
    }

    /// Returns the greatest evidence of a lag; 1 is sure.
    pub(super) fn doubt(&self) -> f64 {
        self.sums.into_iter().fold(0.0, f64::max) / LIMITS[1]
    }
}

#[cfg(test)]
mod tests {
    use common::kinematics::Pose2;

    use super::*;
    use crate::testing::at;

    #[test]
    fn readings_that_waited_and_come_at_once_are_one_and_show_no_delay() {
        let (mut repeats, mut poses) = (Repeats::default(), Poses::default());
        let mut take = |at_s: f64, range_m: f64| {
            poses.robot_is(Pose2 { position: [at_s, 0.0].into(), ..Pose2::default() }, at(at_s));
            repeats.take([(0, range_m)].into_iter(), &poses, at_s);
        };
        let range_m = |tick: u32| 1.0 + (0.618 * f64::from(tick)).fract();
        for tick in 0..20 {
            take(f64::from(tick) / 7.0, range_m(tick));
        }
        for waited in 0..40 {
            take(3.5 + 1e-3 * f64::from(waited), range_m(18 + waited % 2));
        }
        assert_eq!(repeats.judged(false, ""), None);
    }
}
