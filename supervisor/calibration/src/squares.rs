//! Ratio and track from squares whose ends were measured by tape.
//!
//! The squares are those of J. Borenstein and L. Feng, "Measurement and correction of systematic odometry errors in
//! mobile robots", IEEE Trans. Robotics and Automation 12(6), 1996: some to the left and as many to the right, each
//! from the same mark. In place of their formulae the ways of the wheels are integrated again with other values,
//! until the ends are those of the tape.

use std::f64::consts::FRAC_PI_2;

use common::{kinematics::Pose2, mission::Body, samples::GuidanceStatus};
use glam::DVec2;
use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

use crate::{
    loops::{Estimate, Refusal, Wheels, posterior_of_slip, prior},
    wall::{Order, State},
    ways::Ways,
};

/// A corner with so little rest counts as turned; the order is at most this far ahead.
const TURNED_RAD: f64 = 0.03;
const SLOW_RAD: f64 = 0.08;
const FAST_RAD: f64 = 0.5;
const SPEED_M_S: f64 = 0.35;
/// Standard deviation of a coordinate by tape.
const TAPE_M: f64 = 0.005;
/// The fit's problem is nearly linear.
const STEPS: u32 = 5;
/// A value's effect is found by this change.
const NUDGE: f64 = 1e-4;
/// The limit for the pair that is held out, per coordinate.
const AGREES: f64 = 3.0;
/// Half of them are to the left.
pub const FEWEST_SQUARES: usize = 6;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Square {
    side_m: f64,
    /// 1 to the left, -1 to the right.
    turns: f64,
    ways: Ways,
    /// The count is 4 at the end.
    corners: u32,
    turning: bool,
    from_m: f64,
}

impl Square {
    #[must_use]
    pub fn new(side_m: f64, to_the_left: bool) -> Self {
        let turns = if to_the_left { 1.0 } else { -1.0 };
        let ways = Ways::default();
        Self { side_m, turns, ways, corners: 0, turning: false, from_m: 0.0 }
    }

    #[must_use]
    pub const fn state(&self) -> State {
        if self.corners >= 4 { State::Finished } else { State::Running }
    }

    pub fn step(&mut self, counts: [u16; 2], body: &Body) -> Order {
        self.ways.step(counts, body);
        let heading =
            Wheels::NOMINAL.turned(self.ways.left_m, self.ways.right_m, body.track_m) * self.turns;
        let corner = FRAC_PI_2 * f64::from(self.corners + 1);
        let driven = (self.ways.arc_m() - self.from_m).abs();
        if self.turning && corner - heading <= TURNED_RAD {
            self.corners += 1;
            (self.turning, self.from_m) = (false, self.ways.arc_m());
        } else if !self.turning && driven >= self.side_m {
            self.turning = true;
        }
        let target = FRAC_PI_2 * f64::from(self.corners + u32::from(self.turning));
        let left = target - heading;
        let (status, aside, speed_limit_m_s) = if self.state() == State::Finished {
            (GuidanceStatus::AtTarget, 0.0, 0.0)
        } else if self.turning {
            (GuidanceStatus::Look, left.signum() * left.abs().clamp(SLOW_RAD, FAST_RAD), 0.0)
        } else {
            (GuidanceStatus::Along, left.clamp(-FAST_RAD, FAST_RAD), SPEED_M_S)
        };
        Order {
            status,
            aside_rad: aside * self.turns,
            speed_limit_m_s,
            x_m: 0.0,
            heading_rad: heading * self.turns,
        }
    }
}

#[must_use]
pub fn nominal_ways(counts: &[[u16; 2]], body: &Body) -> Vec<[f64; 2]> {
    let mut ways = Ways::default();
    let step = |counts: &[u16; 2]| {
        let before = ways;
        ways.step(*counts, body);
        [ways.left_m - before.left_m, ways.right_m - before.right_m]
    };
    counts.iter().map(step).collect()
}

/// Nominal ways of both wheels in each tick, metres, and the end by tape, in the frame of its start.
#[derive(Clone, Debug, PartialEq)]
pub struct Driven {
    pub ways: Vec<[f64; 2]>,
    pub end: DVec2,
}

impl Driven {
    /// The end, and the variance of a coordinate by slip of 1 m per square root of a metre, m^2.
    fn by(&self, wheels: Wheels, track_m: f64) -> (DVec2, f64) {
        let mut pose = Pose2::default();
        let mut poses = Vec::with_capacity(self.ways.len());
        for [left, right] in &self.ways {
            let turn = wheels.turned(*left, *right, track_m);
            pose = pose.along_arc(f64::midpoint(*left, *right), turn);
            poses.push(pose.position);
        }
        let variance = |([left, right], at): (&[f64; 2], &DVec2)| {
            let rolled = left.abs() + right.abs();
            let turned = pose.position.distance_squared(*at) / (track_m * track_m);
            rolled * (turned + 0.25) / 2.0
        };
        (pose.position, self.ways.iter().zip(&poses).map(variance).sum())
    }
}

/// The least squares for so much slip.
fn fitted(
    squares: &[Driven],
    slip: f64,
    track_m: f64,
) -> Result<(Vector2<f64>, Matrix2<f64>), Refusal> {
    let (mean, covariance) = prior();
    let by_prior = covariance.try_inverse().ok_or(Refusal::Singular)?;
    let mut values = mean;
    let mut information = by_prior;
    for _ in 0..STEPS {
        information = by_prior;
        let mut pull = by_prior * (mean - values);
        for square in squares {
            let end = |e: f64, track: f64| square.by(Wheels::of(e, track), track_m);
            let (here, by_slip) = end(values.x, values.y);
            let weight = 1.0 / (slip * slip * by_slip + TAPE_M * TAPE_M);
            let by_e = (end(values.x + NUDGE, values.y).0 - here) / NUDGE;
            let by_track = (end(values.x, values.y + NUDGE).0 - here) / NUDGE;
            let off = square.end - here;
            information += weight
                * Matrix2::new(
                    by_e.dot(by_e),
                    by_e.dot(by_track),
                    by_e.dot(by_track),
                    by_track.dot(by_track),
                );
            pull += weight * Vector2::new(by_e.dot(off), by_track.dot(off));
        }
        let solved = information.try_inverse().ok_or(Refusal::Singular)? * pull;
        values += solved;
    }
    let covariance = information.try_inverse().ok_or(Refusal::Singular)?;
    Ok((values, covariance))
}

fn estimate(squares: &[Driven], track_m: f64) -> Result<Estimate, Refusal> {
    let off = |values: Vector2<f64>| {
        squares.iter().map(move |square| {
            let (end, by_slip) = square.by(Wheels::of(values.x, values.y), track_m);
            (square.end.distance_squared(end), by_slip)
        })
    };
    let (first, _) = fitted(squares, 0.001, track_m)?;
    let freedom = (2.0 * squares.len() as f64 - 2.0).max(1.0);
    let share = freedom / (2.0 * squares.len() as f64);
    let (slip, slip_sd) = posterior_of_slip(|slip| {
        off(first)
            .map(|(square, by_slip)| {
                let variance = slip * slip * by_slip + TAPE_M * TAPE_M;
                -share * variance.ln() - 0.5 * square / variance
            })
            .sum()
    });
    let used = slip.hypot(slip_sd);
    let (values, covariance) = fitted(squares, used, track_m)?;
    let squared: Vec<f64> = off(values)
        .map(|(square, by_slip)| square / (used * used * by_slip + TAPE_M * TAPE_M))
        .collect();
    let chi2_per_dof = squared.iter().sum::<f64>() / freedom;
    let residuals = squared.into_iter().map(|it| (it / 2.0).sqrt()).collect();
    let found = Estimate::from_parts(values, covariance, [slip, slip_sd], residuals, chi2_per_dof);
    found.is_finite().then_some(found).ok_or(Refusal::Singular)
}

/// The last pair must lie where the others say.
///
/// # Errors
/// Says why nothing may be written.
pub fn checked(squares: &[Driven], track_m: f64) -> Result<Estimate, Refusal> {
    if squares.len() < FEWEST_SQUARES {
        return Err(Refusal::TooFewSquares { found: squares.len() });
    }
    let (others, held_out) = squares.split_at(squares.len() - 2);
    let by_others = estimate(others, track_m)?;
    for square in held_out {
        let deviations =
            by_others.deviations_of_end(|wheels| square.by(wheels, track_m), square.end, TAPE_M);
        // A deviation that is no number does not agree.
        let agrees = deviations <= AGREES;
        if !agrees {
            return Err(Refusal::Contradicted { deviations });
        }
    }
    estimate(squares, track_m)
}

#[cfg(test)]
mod tests;
