//! Whether laser and wheels disagree on every motion, and the likely cause.
//!
//! The way and turn from one fix of the scan matcher to the next are compared with those by the wheels between the same times. Least
//! squares give the turn and way of the fixes over those of the wheels, and how far the way points aside; a delay is the shift of time
//! with which the turns agree best. A cause is named where its deviation by the residuals is far below it, and the fixes share it, so
//! that no number of them makes the pose sure.

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

/// So much of the sums is left after each further pair of fixes: 200 pairs are remembered.
const REMEMBERED: f64 = 1.0 - 1.0 / 200.0;
const LEAST_PAIRS: f64 = 15.0;
/// The fixes of a pair are so far apart, seconds: nearer ones tell more of their own errors than of the motion.
const APART_S: std::ops::RangeInclusive<f64> = 0.18..=1.0;
/// The least way, m^2, and turn, rad^2, squared for each pair and summed up.
const LEAST_WAY: f64 = 0.03;
const LEAST_TURN: f64 = 0.02;
/// The least share of turn and way that the other does not explain.
const LEAST_ALONE: f64 = 0.05;
/// An estimate is this number of its deviations away from none.
const DEVIATIONS: f64 = 6.0;
/// The least share of a motion that a factor must explain: slipping wheels are no factor.
const EXPLAINED: f64 = 0.95;
/// Wheels that nobody calibrated differ less from what is stated.
const FACTOR: f64 = 0.12;
const ASIDE_RAD: f64 = 0.05;
const DELAY_S: f64 = 0.06;
/// A ratio of the wheels that is farther from 1 than this is a cause: wheels that nobody calibrated differ less.
const UNEVEN: f64 = 0.03;
const SHIFTS: usize = 13;
const FIRST_SHIFT_S: f64 = -0.1;
const SHIFT_STEP_S: f64 = 0.05;
/// The sum of squares without a delay is this multiple of that with it.
const BETTER: f64 = 1.5;

/// The pose's variances where there is a cause, m^2 and rad^2.
pub(crate) const DOUBT: [f64; 2] = [0.25, 0.01];

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum Cause {
    Mirrored,
    /// Later than stated, seconds.
    Late(f64),
    /// Looks further to the left than stated, radians.
    Turned(f64),
    /// The way by the fixes over that by the wheels.
    Way(f64),
    /// The turn likewise.
    Turn(f64),
    /// The way of the right wheel over that of the left one, for equal counts.
    Uneven(f64),
}

impl Cause {
    pub(crate) fn words(self) -> String {
        let cause = match self {
            Self::Mirrored => "its beams are mirrored: is roll_deg of its row right?".to_owned(),
            Self::Late(by_s) => format!(
                "its scans are {by_s:.2} s later than their stamps say: mend the stamps, or the clocks"
            ),
            Self::Turned(left) => format!(
                "it looks {:.0} degrees further to the left than its row says: correct turned_deg",
                left.to_degrees()
            ),
            Self::Way(factor) => format!(
                "the robot goes {factor:.2} of the way that its wheels say: correct robot.counts_per_turn or wheel_radius_m"
            ),
            Self::Uneven(ratio) => format!(
                "the right wheel goes {ratio:.2} of the left one's way for the same counts: check encoders and wheels, or `firsthand calibrate`"
            ),
            Self::Turn(factor) => format!(
                "the robot turns {factor:.2} of what its wheels say: correct robot.track_m, or `firsthand calibrate`"
            ),
        };
        format!("laser and wheels disagree on every motion, so the pose is unsure: {cause}")
    }
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Disagreement {
    pair: [Option<Fix>; 2],
    pairs: f64,
    turn: Line,
    way: Line,
    aside: Line,
    /// The fixes' turn by the wheels' way, and the sum of products of the wheels' turn and way.
    bend: Line,
    turn_way: f64,
    /// Squares of the turns' differences by the shift of time.
    shifted: [f64; SHIFTS],
    cause: Option<Cause>,
}

impl Disagreement {
    pub(crate) const fn is_named(&self) -> bool {
        self.cause.is_some()
    }

    /// Compare the two fixes before `newest` with the ticks of the last 2 s, which go on after them. Returns a cause that is new.
    pub(crate) fn compare(
        &mut self,
        newest: &Fix,
        ticks: &VecDeque<Tick>,
        track_m: f64,
    ) -> Option<Cause> {
        // Of all sources only the scan matcher states both.
        if newest.heading.is_none() || newest.shared[1] <= 0.0 {
            return None;
        }
        let apart_s = |from: &Fix, to: &Fix| to.time.seconds() - from.time.seconds();
        let [first, second] = self.pair;
        if second.is_some_and(|second| (0.0..*APART_S.start()).contains(&apart_s(&second, newest)))
        {
            return None;
        }
        self.pair = [second, Some(*newest)];
        let (before, fix) = (first?, second?);
        if !APART_S.contains(&apart_s(&before, &fix)) {
            return None;
        }
        let moved = |shift_s: f64| {
            moved(ticks, before.time.seconds() - shift_s, fix.time.seconds() - shift_s)
        };
        let by_wheels = moved(0.0)?;
        let (from, heading) = (before.heading?, fix.heading?);
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
        for (line, x, y) in [
            (&mut self.turn, by_wheels.heading, turn),
            (&mut self.way, went.x, way.x),
            (&mut self.aside, went.x, way.y - went.y),
            (&mut self.bend, went.x, turn),
        ] {
            line.add(REMEMBERED, x, y);
        }
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
        // A robot that drives curves has turns by its turning and by its way, radians for a metre.
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
        let way = factor(&self.way, LEAST_WAY).map(Cause::Way);
        way.or(turn.map(|turns| Cause::Turn(turns.a[0])))
    }

    /// The delay, seconds, if the turns agree far better with it than without.
    fn late(&self) -> Option<f64> {
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

/// The motion by the wheels between two times, as a pose in the frame of the first; none where ticks are missing.
fn moved(ticks: &VecDeque<Tick>, from_s: f64, to_s: f64) -> Option<Pose2> {
    let first = ticks.front()?;
    if from_s < first.time.seconds() - first.seconds || to_s > ticks.back()?.time.seconds() {
        return None;
    }
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
