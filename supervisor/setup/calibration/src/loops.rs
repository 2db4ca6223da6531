//! Ratio, track and slip from loops that end before the wall they began at. Pure.
//!
//! Between two visits the robot really turned by whole turns, k. With the nominal distances l and r
//! of the wheels, e = (rho - 1) / (rho + 1), the ratio rho of their diameters and the track W tau
//!
//! ```text
//! (r - l + e (r + l)) / (W tau) = 2 pi k,   so   e (r + l) / W - 2 pi k tau = -(r - l) / W,
//! ```
//!
//! This is linear in e and tau. Slip disturbs the right side with variance q^2 times the distance
//! that both wheels rolled, over W^2. So do the two normals, each shared with the next loop.
//! Weighted least squares with a prior gives e and tau. The likelihood of the residuals and a prior
//! give q.

use std::f64::consts::TAU;

use common::mission::Odometry;
use nalgebra::{Cholesky, DMatrix, DVector, Matrix2, Vector2};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Standard deviations about 1.
const PRIOR_RATIO: f64 = 0.01;
const PRIOR_TRACK: f64 = 0.02;
/// Median, metres per square root of a metre, and the deviation of the logarithm.
const PRIOR_SLIP: f64 = 0.002;
const PRIOR_LN_SLIP: f64 = 1.2;
/// Number of slip values tried, a geometric series.
const SLIPS: u32 = 60;
const LEAST_SLIP: f64 = 0.0001;
/// Greatest slip; a floor with more is unfit for driving.
const MOST_SLIP: f64 = 0.01;
/// Prior standard deviation of a normal, and its weight in sweeps.
const PRIOR_NORMAL_RAD: f64 = 0.01;
const PRIOR_NORMALS: f64 = 4.0;
pub const HELD_OUT: usize = 2;
pub const FEWEST_LOOPS: usize = 6;
/// Deviations within which held-out loops must lie.
const AGREES: f64 = 3.0;
/// Deviations beyond which a residual is an accident. Two are a fault of floor or robot.
const ACCIDENT: f64 = 5.0;
/// Limit per degree of freedom.
const MOST_CHI2: f64 = 4.0;

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Loop {
    /// Number among all loops; neighbours share a normal.
    pub number: u32,
    /// Counter-clockwise positive.
    pub turns: f64,
    /// Nominal distances, forward less backward.
    pub left_m: f64,
    pub right_m: f64,
    /// Sum of both wheels' distances.
    pub rolled_m: f64,
}

/// Returns a normal's deviation, radians, from the differences between both directions of each
/// sweep.
pub fn normal_sd(differences: &[f64]) -> f64 {
    let n = differences.len() as f64;
    let mean = differences.iter().sum::<f64>() / n.max(1.0);
    // The mean of both directions has a quarter of their difference's variance.
    let sum = differences.iter().map(|it| (it - mean).powi(2) / 4.0).sum::<f64>();
    let freedom = (n - 1.0).max(0.0);
    ((sum + PRIOR_NORMALS * PRIOR_NORMAL_RAD.powi(2)) / (freedom + PRIOR_NORMALS)).sqrt()
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wheels {
    /// (rho - 1) / (rho + 1).
    pub(crate) e: f64,
    /// Value of tau.
    pub(crate) track: f64,
}

/// Nominal wheels.
impl Default for Wheels {
    fn default() -> Self {
        Self { e: 0.0, track: 1.0 }
    }
}

impl Wheels {
    /// Returns the turn for these nominal distances, radians.
    pub fn turned(self, left_m: f64, right_m: f64, track_m: f64) -> f64 {
        (right_m - left_m + self.e * (right_m + left_m)) / (track_m * self.track)
    }
}

/// Returns mean and standard deviation of the slip, given the log-likelihood.
fn posterior_of_slip(ln_likelihood: impl Fn(f64) -> f64) -> (f64, f64) {
    const { assert!(LEAST_SLIP < PRIOR_SLIP && PRIOR_SLIP < MOST_SLIP) };
    let step = (MOST_SLIP / LEAST_SLIP).ln() / f64::from(SLIPS - 1);
    let posterior: Vec<(f64, f64)> = (0..SLIPS)
        .map(|index| LEAST_SLIP * (step * f64::from(index)).exp())
        .map(|slip| {
            let ln_prior = -0.5 * ((slip / PRIOR_SLIP).ln() / PRIOR_LN_SLIP).powi(2);
            (slip, ln_prior + ln_likelihood(slip))
        })
        .collect();
    let most = posterior.iter().map(|(_, ln)| *ln).fold(f64::NEG_INFINITY, f64::max);
    let weights: f64 = posterior.iter().map(|(_, ln)| (ln - most).exp()).sum();
    let mean_of = |power: i32| {
        posterior.iter().map(|(slip, ln)| slip.powi(power) * (ln - most).exp()).sum::<f64>()
            / weights
    };
    let (mean, square) = (mean_of(1), mean_of(2));
    (mean, (square - mean * mean).max(0.0).sqrt())
}

#[derive(Debug, PartialEq)]
pub struct Estimate {
    values: Vector2<f64>,
    covariance: Matrix2<f64>,
    pub slip: f64,
    pub slip_sd: f64,
    /// Residual per loop, in its standard deviations.
    pub residuals: Vec<f64>,
    pub chi2_per_dof: f64,
}

#[derive(Clone, Debug, Error, PartialEq)]
pub enum Refusal {
    #[error(
        "{found} loops are too few, {FEWEST_LOOPS} are needed; let the calibration finish, or clear the floor before the wall"
    )]
    TooFew { found: usize },
    #[error("{found} squares are too few; drive at least three to the left and three to the right")]
    TooFewSquares { found: usize },
    #[error(
        "the residuals of {loops} loops exceed {ACCIDENT} standard deviations; check floor and wheels, then repeat the calibration"
    )]
    Accidents { loops: usize },
    #[error(
        "chi^2 is {chi2_per_dof:.1} per degree of freedom, over {MOST_CHI2}: the floor is too slippery; repeat the calibration on another floor"
    )]
    Scattered { chi2_per_dof: f64 },
    #[error(
        "the held-out data differs from the fit by {deviations:.1} standard deviations, over {AGREES}; repeat the calibration"
    )]
    Contradicted { deviations: f64 },
    #[error(
        "the robot stood for {seconds:.1} s before it moved, too short for the gyro's bias; repeat the calibration on a machine with less load"
    )]
    NoRest { seconds: f64 },
    #[error(
        "the robot drove only {driven_m:.1} m and turned only {turned_deg:.0} degrees; clear 2.5 m of floor ahead of it and 0.5 m around it"
    )]
    Short { driven_m: f64, turned_deg: f64 },
    #[error("the loops cannot be fitted; repeat the calibration")]
    Singular,
}

pub(crate) struct Rows {
    design: DMatrix<f64>,
    values: DVector<f64>,
    /// Variance by slip for q = 1, and covariance by other errors.
    by_slip: DMatrix<f64>,
    otherwise: DMatrix<f64>,
}

impl Rows {
    /// Each row has the factors of e and tau, the value, and the variance by slip.
    pub(crate) fn new(rows: &[([f64; 2], f64, f64)], otherwise: DMatrix<f64>) -> Self {
        let n = rows.len();
        assert_eq!(otherwise.shape(), (n, n));
        let by_slip = DVector::from_fn(n, |row, _| rows[row].2);
        Self {
            design: DMatrix::from_fn(n, 2, |row, column| rows[row].0[column]),
            values: DVector::from_fn(n, |row, _| rows[row].1),
            by_slip: DMatrix::from_diagonal(&by_slip),
            otherwise,
        }
    }

    fn by_loops(loops: &[Loop], normal_sd: f64, track_m: f64) -> Self {
        let row = |it: &Loop| {
            let factors = [(it.right_m + it.left_m) / track_m, -TAU * it.turns];
            let turned = (it.right_m - it.left_m) / track_m;
            (factors, -turned, it.rolled_m / (track_m * track_m))
        };
        let (n, variance) = (loops.len(), normal_sd * normal_sd);
        let by_normals = DMatrix::from_fn(n, n, |row, column| {
            match loops[row].number.abs_diff(loops[column].number) {
                0 => 2.0 * variance,
                1 => -variance,
                _ => 0.0,
            }
        });
        Self::new(&loops.iter().map(row).collect::<Vec<_>>(), by_normals)
    }

    fn noise(&self, slip: f64) -> DMatrix<f64> {
        &self.by_slip * (slip * slip) + &self.otherwise
    }
}

impl Estimate {
    /// Estimates the wheels from loops; `track_m` is nominal.
    ///
    /// # Errors
    /// Fails if the numbers are not finite.
    pub fn by_loops(loops: &[Loop], normal_sd: f64, track_m: f64) -> Result<Self, Refusal> {
        Self::of(&Rows::by_loops(loops, normal_sd, track_m))
    }

    pub(crate) fn of(rows: &Rows) -> Result<Self, Refusal> {
        // e is half of rho - 1.
        let variances = Vector2::new((PRIOR_RATIO / 2.0).powi(2), PRIOR_TRACK.powi(2));
        let (mean, covariance) = (Vector2::new(0.0, 1.0), Matrix2::from_diagonal(&variances));
        let surprise = &rows.values - &rows.design * mean;
        let by_prior = &rows.design * covariance * rows.design.transpose();
        let factor =
            |slip: f64| Cholesky::new(rows.noise(slip) + &by_prior).ok_or(Refusal::Singular);
        let (slip, slip_sd) = posterior_of_slip(|slip| {
            factor(slip).map_or(f64::NAN, |factor| {
                -0.5 * factor.ln_determinant() - 0.5 * surprise.dot(&factor.solve(&surprise))
            })
        });
        let used = slip.hypot(slip_sd);
        let factor = factor(used)?;
        let gain = covariance * rows.design.transpose();
        let values = mean + &gain * factor.solve(&surprise);
        let posterior = covariance - &gain * factor.solve(&gain.transpose());
        let left = &rows.values - &rows.design * values;
        let noise = rows.noise(used);
        let residuals = (0..left.len()).map(|row| left[row] / noise[(row, row)].sqrt()).collect();
        let whitened = Cholesky::new(noise).ok_or(Refusal::Singular)?.solve(&left);
        let freedom = (left.len() as f64 - 2.0).max(1.0);
        let chi2_per_dof = left.dot(&whitened) / freedom;
        let found = Self { values, covariance: posterior, slip, slip_sd, residuals, chi2_per_dof };
        let is_finite = found
            .values
            .iter()
            .chain(&found.covariance)
            .chain([&slip, &slip_sd])
            .copied()
            .all(f64::is_finite);
        is_finite.then_some(found).ok_or(Refusal::Singular)
    }

    /// Checks the residuals.
    pub(crate) fn unless_scattered(self) -> Result<Self, Refusal> {
        if self.chi2_per_dof > MOST_CHI2 {
            Err(Refusal::Scattered { chi2_per_dof: self.chi2_per_dof })
        } else {
            Ok(self)
        }
    }

    /// Returns rho: right over left.
    pub fn ratio(&self) -> f64 {
        (1.0 + self.values.x) / (1.0 - self.values.x)
    }

    pub fn ratio_sd(&self) -> f64 {
        2.0 * self.covariance[(0, 0)].max(0.0).sqrt() / (1.0 - self.values.x).powi(2)
    }

    /// Returns tau: on the ground over nominal.
    pub fn track(&self) -> f64 {
        self.values.y
    }

    pub fn track_sd(&self) -> f64 {
        self.covariance[(1, 1)].max(0.0).sqrt()
    }

    pub fn wheels(&self) -> Wheels {
        Wheels { e: self.values.x, track: self.values.y }
    }

    /// Returns the RMS prediction error of held-out values, in standard deviations.
    fn deviations(&self, held_out: &Rows) -> f64 {
        let off = &held_out.values - &held_out.design * self.values;
        let by_values = &held_out.design * self.covariance * held_out.design.transpose();
        let spread = held_out.noise(self.slip.hypot(self.slip_sd)) + by_values;
        let square = Cholesky::new(spread).map_or(f64::NAN, |factor| off.dot(&factor.solve(&off)));
        (square / off.len() as f64).sqrt()
    }

    pub(crate) fn agrees_with(&self, held_out: &Rows) -> Result<(), Refusal> {
        let deviations = self.deviations(held_out);
        // NaN counts as a contradiction.
        (deviations <= AGREES).then_some(()).ok_or(Refusal::Contradicted { deviations })
    }

    /// Returns values for `[robot.odometry]`, without provenance. Loops leave the distance scale
    /// undetermined.
    pub fn odometry(&self, before: &Odometry) -> Odometry {
        Odometry {
            diameter_ratio: self.ratio(),
            diameter_ratio_sd: self.ratio_sd(),
            track_scale: self.track(),
            track_scale_sd: self.track_sd(),
            distance_scale: before.distance_scale,
            distance_scale_sd: before.distance_scale_sd,
            slip: self.slip,
            slip_sd: self.slip_sd,
            calibrated: None,
        }
    }
}

/// Returns the estimate.
///
/// Drops at most one accident. The two held-out loops must lie where the others predict.
///
/// # Errors
/// Returns why nothing may be written.
pub fn checked(loops: &[Loop], normal_sd: f64, track_m: f64) -> Result<Estimate, Refusal> {
    if loops.len() < FEWEST_LOOPS {
        return Err(Refusal::TooFew { found: loops.len() });
    }
    let by_loops = |loops: &[Loop]| Rows::by_loops(loops, normal_sd, track_m);
    let mut used = loops.to_vec();
    let mut accidents = 0;
    loop {
        let mut worst = (0, 0.0);
        for (index, held_out) in used.iter().enumerate() {
            let others = used.iter().filter(|it| it.number != held_out.number);
            let others = Estimate::of(&by_loops(&others.copied().collect::<Vec<_>>()))?;
            let deviations = others.deviations(&by_loops(&[*held_out]));
            if deviations > worst.1 {
                worst = (index, deviations);
            }
        }
        if worst.1 <= ACCIDENT {
            break;
        }
        accidents += 1;
        if accidents > 1 {
            return Err(Refusal::Accidents { loops: accidents });
        }
        used.remove(worst.0);
    }
    const { assert!(HELD_OUT + 1 < FEWEST_LOOPS) };
    assert_eq!(used.len() + accidents, loops.len());
    let (others, held_out) = used.split_at(used.len() - HELD_OUT);
    let by_others = Estimate::of(&by_loops(others))?;
    for held_out in held_out {
        by_others.agrees_with(&by_loops(&[*held_out]))?;
    }
    Estimate::of(&by_loops(&used))?.unless_scattered()
}

#[cfg(test)]
mod tests;
