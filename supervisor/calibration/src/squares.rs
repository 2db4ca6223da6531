//! Ratio and track from squares whose ends were measured by tape.
//!
//! The squares are those of J. Borenstein and L. Feng, "Measurement and correction of systematic odometry errors in
//! mobile robots", IEEE Trans. Robotics and Automation 12(6), 1996: some to the left and as many to the right, each
//! from the same mark. In place of their formulae the ways of the wheels are integrated again with other values,
//! until the ends are those of the tape.

use std::f64::consts::FRAC_PI_2;

use common::{kinematics::Pose2, mission::Body, samples::GuidanceStatus};
use glam::DVec2;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::{
    loops::{Estimate, Refusal, Rows, Wheels},
    wall::{FAST_RAD, Order, SPEED_M_S, State, direction_aside},
    ways::Ways,
};

/// A corner with so little rest counts as turned.
const TURNED_RAD: f64 = 0.03;
/// Standard deviation of a coordinate by tape.
const TAPE_M: f64 = 0.005;
/// The fit's problem is nearly linear.
const STEPS: u32 = 5;
/// A value's effect is found by this change.
const NUDGE: f64 = 1e-4;
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
            (GuidanceStatus::Look, direction_aside(left, FAST_RAD), 0.0)
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

/// The ends by tape, linear in e and tau near `wheels`: x and y of each square.
fn rows(squares: &[Driven], wheels: Wheels, track_m: f64) -> Rows {
    let Wheels { e, track } = wheels;
    let rows = squares.iter().flat_map(|square| {
        let end = |e, track| square.by(Wheels { e, track }, track_m);
        let (here, by_slip) = end(e, track);
        let by_e = (end(e + NUDGE, track).0 - here) / NUDGE;
        let by_track = (end(e, track + NUDGE).0 - here) / NUDGE;
        let value = square.end - here + by_e * e + by_track * track;
        [0, 1].map(|axis| ([by_e[axis], by_track[axis]], value[axis], by_slip))
    });
    let rows: Vec<_> = rows.collect();
    let by_tape = DMatrix::from_diagonal_element(rows.len(), rows.len(), TAPE_M * TAPE_M);
    Rows::new(&rows, by_tape)
}

fn estimate(squares: &[Driven], track_m: f64) -> Result<Estimate, Refusal> {
    let mut wheels = Wheels::NOMINAL;
    for _ in 1..STEPS {
        wheels = Estimate::of(&rows(squares, wheels, track_m))?.wheels();
    }
    let mut found = Estimate::of(&rows(squares, wheels, track_m))?;
    let of_square = |pair: &[f64]| (pair.iter().map(|it| it * it).sum::<f64>() / 2.0).sqrt();
    found.residuals = found.residuals.chunks(2).map(of_square).collect();
    Ok(found)
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
        let held_out = rows(std::slice::from_ref(square), by_others.wheels(), track_m);
        by_others.agrees_with(&held_out)?;
    }
    estimate(squares, track_m)
}

#[cfg(test)]
mod tests;
