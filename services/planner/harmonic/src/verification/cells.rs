//! The checks of the cells of one row.

use crate::real::Real;

/// Largest componentwise relative residual of a published field.
pub(super) const RESIDUAL_LIMIT: f64 = 2e-5;

/// Largest [`Verification::worst_tile`](super::Verification::worst_tile) of a published field.
pub(super) const TILE_LIMIT: f64 = 0.01;

/// The result of a verification.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Check {
    /// Largest relative residual of the cells with u > 0 but the target.
    pub worst_residual: f64,
    /// See [`Verification`](super::Verification).
    pub worst_tile: f64,
    /// Cells with u > 0, other than the target, that no neighbour exceeds.
    pub local_maxima: usize,
    /// Free cells with u = 0 beside one with u > 0.
    pub unreached: usize,
    /// Cells with u > 0.
    pub reachable: usize,
}

impl Check {
    /// The combined result of both.
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            worst_residual: self.worst_residual.max(other.worst_residual),
            worst_tile: self.worst_tile.max(other.worst_tile),
            local_maxima: self.local_maxima + other.local_maxima,
            unreached: self.unreached + other.unreached,
            reachable: self.reachable + other.reachable,
        }
    }

    /// The largest residual as a multiple of the limit.
    pub(crate) fn excess(&self) -> f64 {
        self.worst_residual / RESIDUAL_LIMIT
    }

    /// Whether the field may be handed out.
    pub(crate) fn holds(&self) -> bool {
        self.unreached == 0 && self.holds_where_reached()
    }

    /// Whether the cells of u > 0 are right.
    pub(crate) fn holds_where_reached(&self) -> bool {
        self.local_maxima == 0
            && self.worst_residual <= RESIDUAL_LIMIT
            && self.worst_tile <= TILE_LIMIT
    }
}

/// u of the cells of a row and of their neighbours, all with the exponent of the cell itself; 0 where blocked.
#[derive(Clone, Copy)]
pub(super) struct Around<'a, R> {
    pub here: &'a [R],
    pub west: &'a [R],
    pub east: &'a [R],
    pub north: &'a [R],
    pub south: &'a [R],
}

/// The equations of the cells of a row, and their residuals.
pub(super) struct Cells<R> {
    /// 0.25 / (1 + k) of each cell, 0 where no equation holds.
    pub weights: Vec<R>,
    /// Relative residuals, with their signs, of the cells an equation holds for.
    pub residuals: Vec<R>,
    /// (|grad u| / u)^2 of the cells in `residuals`.
    pub slopes: Vec<R>,
    /// Cells in which u is no larger are not checked.
    floor: R,
}

impl<R: Real> Cells<R> {
    /// Rows of `width` cells, of which those with a larger u than `floor` are checked.
    pub(super) fn above(width: usize, floor: f64) -> Self {
        let row = vec![R::default(); width];
        Self { weights: row.clone(), residuals: row.clone(), slopes: row, floor: R::of(floor) }
    }

    /// Checks the cells of a row; `raw` are their stored values.
    #[inline(always)]
    pub(super) fn check(&mut self, raw: &[R], u: Around<'_, R>, found: &mut Check) {
        let (n, zero, floor) = (raw.len(), R::default(), self.floor);
        let Around { here, west, east, north, south } = u;
        let (here, west, east) = (&here[..n], &west[..n], &east[..n]);
        let (north, south, weights) = (&north[..n], &south[..n], &self.weights[..n]);
        let (residuals, slopes) = (&mut self.residuals[..n], &mut self.slopes[..n]);
        let quarter = R::of(0.25);
        let larger = |a: R, b: R| if a > b { a } else { b };
        let (mut local_maxima, mut unreached, mut reachable) = (0_u32, 0_u32, 0_u32);
        for x in 0..n {
            let sum = (west[x] + east[x]) + (north[x] + south[x]);
            let best = larger(larger(west[x], east[x]), larger(north[x], south[x]));
            let positive = here[x] > floor;
            reachable += u32::from(positive);
            // A value that is no number is neither blocked nor positive, so it counts as unreached.
            let blocked = raw[x] < zero;
            unreached += u32::from(!positive & !blocked & (sum > zero));
            let residual = here[x] - weights[x] * sum;
            let holds = positive & (weights[x] > zero);
            local_maxima += u32::from(holds & (best <= here[x]));
            let scale = if holds { R::ONE / here[x] } else { zero };
            residuals[x] = residual * scale;
            let (across, along) = ((east[x] - west[x]) * scale, (south[x] - north[x]) * scale);
            slopes[x] = quarter * (across * across + along * along);
        }
        // The maximum is taken in lanes, because a running maximum over floats is not vectorised.
        let mut worst = [zero; 16];
        let chunks = residuals.chunks_exact(16);
        for (lane, &residual) in worst.iter_mut().zip(chunks.remainder()) {
            *lane = larger(residual.size(), *lane);
        }
        for chunk in chunks {
            for (lane, &residual) in worst.iter_mut().zip(chunk) {
                *lane = larger(residual.size(), *lane);
            }
        }
        let worst = worst.into_iter().fold(zero, larger).wide();
        found.worst_residual = found.worst_residual.max(worst);
        found.local_maxima += local_maxima as usize;
        found.unreached += unreached as usize;
        found.reachable += reachable as usize;
    }
}
