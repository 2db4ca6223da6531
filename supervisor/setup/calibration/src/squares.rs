//! Ratio and track from squares whose ends were measured by tape.
//!
//! The squares follow J. Borenstein and L. Feng, "Measurement and correction of systematic odometry
//! errors in mobile robots", IEEE Trans. Robotics and Automation 12(6), 1996: equally many to the
//! left and to the right, each from the same mark. Instead of their formulae, a fit integrates the
//! wheel distances until the ends match the tape.

use common::{kinematics::Pose2, mission::Body};
use glam::DVec2;
use nalgebra::DMatrix;

use crate::{
    loops::{Estimate, Refusal, Rows, Wheels},
    ways::Ways,
};

/// Standard deviation of a coordinate by tape.
const TAPE_M: f64 = 0.005;
/// Iterations of the fit; the problem is nearly linear.
const STEPS: u32 = 5;
/// Change for the numerical derivative of a value.
const NUDGE: f64 = 1e-4;
/// Fewest squares, half of them to the left.
pub const FEWEST_SQUARES: usize = 6;

pub fn nominal_ways(counts: &[[u16; 2]], body: &Body) -> Vec<[f64; 2]> {
    let mut ways = Ways::default();
    let step = |counts: &[u16; 2]| {
        let before = ways;
        ways.step(*counts, body);
        [ways.left_m - before.left_m, ways.right_m - before.right_m]
    };
    counts.iter().map(step).collect()
}

/// Nominal distances of both wheels per tick, metres, and the taped end, in the frame of its start.
#[derive(Debug)]
pub struct Driven {
    pub ways: Vec<[f64; 2]>,
    pub end: DVec2,
}

impl Driven {
    /// Returns the end, and a coordinate's variance for a slip of 1 m per square root of a metre,
    /// m^2.
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

/// Returns the taped ends as equations in e and tau, linear near `wheels`: x and y of each square.
fn rows(squares: &[Driven], wheels: Wheels, track_m: f64) -> Rows {
    let Wheels { e, track } = wheels;
    let rows: Vec<_> = squares
        .iter()
        .flat_map(|square| {
            let end = |e, track| square.by(Wheels { e, track }, track_m);
            let (here, by_slip) = end(e, track);
            let by_e = (end(e + NUDGE, track).0 - here) / NUDGE;
            let by_track = (end(e, track + NUDGE).0 - here) / NUDGE;
            let value = square.end - here + by_e * e + by_track * track;
            [0, 1].map(|axis| ([by_e[axis], by_track[axis]], value[axis], by_slip))
        })
        .collect();
    let by_tape = DMatrix::from_diagonal_element(rows.len(), rows.len(), TAPE_M * TAPE_M);
    Rows::new(&rows, by_tape)
}

fn estimate(squares: &[Driven], track_m: f64) -> Result<Estimate, Refusal> {
    let mut wheels = Wheels::default();
    for _ in 1..STEPS {
        wheels = Estimate::of(&rows(squares, wheels, track_m))?.wheels();
    }
    let mut found = Estimate::of(&rows(squares, wheels, track_m))?;
    let of_square = |pair: &[f64]| (pair.iter().map(|it| it * it).sum::<f64>() / 2.0).sqrt();
    found.residuals = found.residuals.chunks(2).map(of_square).collect();
    assert_eq!(found.residuals.len(), squares.len());
    Ok(found)
}

/// Returns the estimate, if the last pair lies where the others predict.
///
/// # Errors
/// Returns why nothing may be written.
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
