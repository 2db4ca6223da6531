//! Steady disagreement of laser and wheels, and its likely cause.
//!
//! The motion between two fixes of the scan matcher is compared with that by the wheels. Least
//! squares give the ratios of turn and distance, and the sideways share. The delay is the time
//! shift of best agreement. A cause that far exceeds its deviation by the residuals is named. All
//! fixes share it, so more of them do not make the pose surer.

use std::collections::VecDeque;

use common::{
    kinematics::{Pose2, Twist},
    least_squares::{Line, Two},
};
use serde::{Deserialize, Serialize};

use crate::{
    filter::{Fix, wrapped},
    tick::Tick,
};

/// Weight left after each pair of fixes: a memory of 200.
const REMEMBERED: f64 = 1.0 - 1.0 / 200.0;
const LEAST_PAIRS: f64 = 15.0;
/// Seconds between the fixes of a pair. Closer ones show mostly their own errors.
const APART_S: std::ops::RangeInclusive<f64> = 0.18..=1.0;
/// Least sums of squared distance, m^2, and turn, rad^2.
const LEAST_WAY: f64 = 0.03;
const LEAST_TURN: f64 = 0.02;
/// Least share of turn and distance that the other does not explain.
const LEAST_ALONE: f64 = 0.05;
/// Least estimate, in its deviations.
const DEVIATIONS: f64 = 6.0;
/// Least explained share of a motion; slip yields no constant factor.
const EXPLAINED: f64 = 0.95;
/// Least causes: uncalibrated wheels differ less.
const FACTOR: f64 = 0.12;
const ASIDE_RAD: f64 = 0.05;
const DELAY_S: f64 = 0.06;
/// Least difference of the wheels' ratio from 1. Uncalibrated wheels differ less.
const UNEVEN: f64 = 0.03;
const SHIFTS: usize = 13;
const FIRST_SHIFT_S: f64 = -0.1;
const SHIFT_STEP_S: f64 = 0.05;
/// Least ratio of squares without a delay to those with it.
const BETTER: f64 = 1.5;

/// Pose variances under a cause, m^2 and rad^2.
pub(crate) const DOUBT: [f64; 2] = [0.25, 0.01];

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum Cause {
    Mirrored,
    /// Seconds beyond the stated delay.
    Late(f64),
    /// Mounted further left than stated, radians.
    Turned(f64),
    /// By fixes over that by wheels.
    Way(f64),
    /// By fixes over that by wheels.
    Turn(f64),
    /// Right wheel's travel over the left's, for equal counts.
    Uneven(f64),
}

impl Cause {
    pub(crate) fn words(self) -> String {
        let cause = match self {
            Self::Mirrored => {
                "the laser's beams are mirrored; check roll_deg of its row".to_owned()
            }
            Self::Late(by_s) => format!(
                "the laser's scans are {by_s:.2} s later than their stamps; correct the stamps, or synchronise the clocks"
            ),
            Self::Turned(left) => format!(
                "the laser looks {:.0} degrees further to the left than its row states; correct turned_deg",
                left.to_degrees()
            ),
            Self::Way(factor) => format!(
                "the robot travels {factor:.2} of the distance that its wheels report; correct robot.counts_per_turn or wheel_radius_m"
            ),
            Self::Uneven(ratio) => format!(
                "the right wheel travels {ratio:.2} of the left wheel's distance for the same counts; check encoders and wheels, or run `firsthand calibrate`"
            ),
            Self::Turn(factor) => format!(
                "the robot turns {factor:.2} of the angle that its wheels report; correct robot.track_m, or run `firsthand calibrate`"
            ),
        };
        format!("laser and wheels disagree on every motion, so the pose is uncertain: {cause}")
    }
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Disagreement {
    pair: [Option<Fix>; 2],
    pairs: f64,
    turn: Line,
    way: Line,
    aside: Line,
    /// Fixes' turn by wheels' distance, and the products of wheels' turn and distance.
    bend: Line,
    turn_way: f64,
    /// Squared turn differences by time shift.
    shifted: [f64; SHIFTS],
    cause: Option<Cause>,
}

impl Disagreement {
    pub(crate) const fn is_named(&self) -> bool {
        self.cause.is_some()
    }

    pub(crate) fn compare(
        &mut self,
        newest: &Fix,
        ticks: &VecDeque<Tick>,
        track_m: f64,
    ) -> Option<Cause> {
        if !newest.is_by_scan() {
            return None;
        }
        let apart_s = |from: &Fix, to: &Fix| to.time.seconds() - from.time.seconds();
        let [first, second] = self.pair;
        if second.is_some_and(|second| (0.0..*APART_S.start()).contains(&apart_s(&second, newest)))
        {
            return None;
        }
        self.pair = [second, Some(*newest)];
        let before = first?;
        let fix = second?;
        if !APART_S.contains(&apart_s(&before, &fix)) {
            return None;
        }
        let moved = |shift_s: f64| {
            moved(ticks, before.time.seconds() - shift_s, fix.time.seconds() - shift_s)
        };
        let by_wheels = moved(0.0)?;
        let from = before.heading?;
        let heading = fix.heading?;
        let way = (fix.position - before.position).rotate(glam::DVec2::from_angle(-from));
        let turn = wrapped(heading - from);
        let mut squares = [0.0; SHIFTS];
        for (step, square) in squares.iter_mut().enumerate() {
            let difference = turn - moved(shift_s(step as f64))?.heading;
            *square = difference * difference;
        }
        for (sum, square) in self.shifted.iter_mut().zip(squares) {
            *sum = *sum * REMEMBERED + square;
        }
        self.pairs = self.pairs * REMEMBERED + 1.0;
        let went = by_wheels.position;
        self.turn.add(REMEMBERED, by_wheels.heading, turn);
        self.way.add(REMEMBERED, went.x, way.x);
        self.aside.add(REMEMBERED, went.x, way.y - went.y);
        self.bend.add(REMEMBERED, went.x, turn);
        self.turn_way = self.turn_way * REMEMBERED + by_wheels.heading * went.x;
        if self.is_named() || self.pairs < LEAST_PAIRS {
            return None;
        }
        self.cause = self.likely(track_m);
        self.cause
    }

    fn likely(&self, track_m: f64) -> Option<Cause> {
        let is_off = |factor: f64, deviation: f64, explained: f64| {
            (factor - 1.0).abs() > FACTOR.max(DEVIATIONS * deviation) && explained > EXPLAINED
        };
        let factor = |line: &Line, least: f64| {
            let (factor, deviation) = line.factor(self.pairs);
            let explained = factor * line.xy / line.yy;
            (line.xx >= least && is_off(factor, deviation, explained)).then_some(factor)
        };
        if factor(&self.turn, LEAST_TURN).is_some_and(|turn| turn < 0.0) {
            return Some(Cause::Mirrored);
        }
        if let Some(by_s) = self.late() {
            return Some(Cause::Late(by_s));
        }
        // In curves the turn has one part by turning and one by distance, rad/m.
        let turns = (self.turn.xx >= LEAST_TURN)
            .then(|| Two::of(&self.turn, &self.bend, self.turn_way, self.pairs, LEAST_ALONE))
            .flatten();
        if let Some(Two { b: [bend, deviation], .. }) = turns
            && bend.abs() > (UNEVEN / track_m).max(DEVIATIONS * deviation)
        {
            return Some(Cause::Uneven(1.0 + bend * track_m));
        }
        let (aside, deviation) = self.aside.factor(self.pairs);
        if self.aside.xx >= LEAST_WAY && aside.abs() > ASIDE_RAD.max(DEVIATIONS * deviation) {
            return Some(Cause::Turned(-aside.clamp(-1.0, 1.0).asin()));
        }
        let turn = turns.filter(|Two { a: [factor, deviation], rest, .. }| {
            is_off(*factor, *deviation, 1.0 - rest / self.turn.yy)
        });
        factor(&self.way, LEAST_WAY).map(Cause::Way).or(turn.map(|turns| Cause::Turn(turns.a[0])))
    }

    fn late(&self) -> Option<f64> {
        assert!(self.pairs >= LEAST_PAIRS);
        let unshifted = self.shifted[(-FIRST_SHIFT_S / SHIFT_STEP_S).round() as usize];
        let best = (1..SHIFTS - 1)
            .min_by(|one, other| self.shifted[*one].total_cmp(&self.shifted[*other]))?;
        let [before, least, after] = [best - 1, best, best + 1].map(|step| self.shifted[step]);
        let curvature = before - 2.0 * least + after;
        let between = if curvature > 0.0 { 0.5 * (before - after) / curvature } else { 0.0 };
        let by_s = shift_s(best as f64 + between);
        let tells = self.turn.xx >= LEAST_TURN
            && unshifted > BETTER.max(1.0 + DEVIATIONS * DEVIATIONS / self.pairs) * least;
        (tells && by_s.abs() > DELAY_S).then_some(by_s)
    }
}

fn shift_s(step: f64) -> f64 {
    FIRST_SHIFT_S + step * SHIFT_STEP_S
}

/// Returns the wheels' motion between two times, in the frame of the first; none if ticks are
/// missing.
fn moved(ticks: &VecDeque<Tick>, from_s: f64, to_s: f64) -> Option<Pose2> {
    let first = ticks.front()?;
    if from_s < first.time.seconds() - first.seconds || to_s > ticks.back()?.time.seconds() {
        return None;
    }
    assert!(from_s <= to_s);
    let mut pose = Pose2::default();
    for tick in ticks {
        let end_s = tick.time.seconds();
        let within_s = end_s.min(to_s) - (end_s - tick.seconds).max(from_s);
        if within_s > 0.0 && tick.seconds > 0.0 {
            let share = within_s / tick.seconds;
            let Twist { v, omega } = tick.moved();
            pose = pose.along_arc(v * share, omega * share);
        }
    }
    Some(pose)
}

#[cfg(test)]
mod tests;
