//! Checks of the cells of one row.

use crate::real::Real;

pub(super) const RESIDUAL_LIMIT: f64 = 2e-5;

/// Limit of [`Verification::worst_tile`](super::Verification::worst_tile) in a published field.
pub(super) const TILE_LIMIT: f64 = 0.01;

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Check {
    pub worst_residual: f64,
    pub worst_tile: f64,
    /// Cells with u > 0, except the target, that no neighbour exceeds.
    pub local_maxima: usize,
    /// Free cells with u = 0 beside one with u > 0.
    pub unreached: usize,
    pub reachable: usize,
}

impl Check {
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            worst_residual: self.worst_residual.max(other.worst_residual),
            worst_tile: self.worst_tile.max(other.worst_tile),
            local_maxima: self.local_maxima + other.local_maxima,
            unreached: self.unreached + other.unreached,
            reachable: self.reachable + other.reachable,
        }
    }

    pub(crate) fn excess(&self) -> f64 {
        self.worst_residual / RESIDUAL_LIMIT
    }

    pub(crate) fn holds(&self) -> bool {
        self.unreached == 0 && self.holds_where_reached()
    }

    pub(crate) fn holds_where_reached(&self) -> bool {
        self.local_maxima == 0
            && self.worst_residual <= RESIDUAL_LIMIT
            && self.worst_tile <= TILE_LIMIT
    }
}

/// u of the cells of a row and of their neighbours, with the exponent of the cell itself; 0 if
/// blocked.
#[derive(Clone, Copy)]
pub(super) struct Around<'a, R> {
    pub here: &'a [R],
    pub west: &'a [R],
    pub east: &'a [R],
    pub north: &'a [R],
    pub south: &'a [R],
}

pub(super) struct Cells<R> {
    /// 0.25 / (1 + k) of each cell; 0 where no equation holds.
    pub weights: Vec<R>,
    /// Signed relative residuals of the cells that have an equation.
    pub residuals: Vec<R>,
    /// (|grad u| / u)^2 of the cells in `residuals`.
    pub slopes: Vec<R>,
    /// Threshold of u; only cells above it are checked.
    floor: R,
}

impl<R: Real> Cells<R> {
    pub(super) fn above(width: usize, floor: f64) -> Self {
        let row = vec![R::default(); width];
        Self { weights: row.clone(), residuals: row.clone(), slopes: row, floor: R::of(floor) }
    }

    #[inline(always)]
    pub(super) fn check(&mut self, raw: &[R], u: Around<'_, R>, found: &mut Check) {
        let (n, zero, floor) = (raw.len(), R::default(), self.floor);
        let Around { here, west, east, north, south } = u;
        let (here, west, east) = (&here[..n], &west[..n], &east[..n]);
        let (north, south, weights) = (&north[..n], &south[..n], &self.weights[..n]);
        let (residuals, slopes) = (&mut self.residuals[..n], &mut self.slopes[..n]);
        assert_eq!(n, self.weights.len());
        let quarter = R::of(0.25);
        let larger = |a: R, b: R| if a > b { a } else { b };
        let (mut local_maxima, mut unreached, mut reachable) = (0_u32, 0_u32, 0_u32);
        for x in 0..n {
            let sum = (west[x] + east[x]) + (north[x] + south[x]);
            let best = larger(larger(west[x], east[x]), larger(north[x], south[x]));
            let positive = here[x] > floor;
            reachable += u32::from(positive);
            // NaN is neither blocked nor positive, so it counts as unreached.
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
        // A running maximum over floats does not vectorise, so the maximum is taken in lanes.
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
