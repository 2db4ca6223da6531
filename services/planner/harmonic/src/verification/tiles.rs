//! Sums of residuals over tiles of the map.

use crate::real::Real;

pub(super) const TILE: usize = 64;

pub(super) struct Tiles {
    /// Sums of the signed relative residuals and of (|grad u| / u)^2.
    sums: Vec<[f64; 2]>,
    worst: f64,
}

impl Tiles {
    pub(super) fn new(width: usize) -> Self {
        Self { sums: vec![[0.0; 2]; width.div_ceil(TILE)], worst: 0.0 }
    }

    /// Adds row `row` of the map; the first row of a tile ends the tiles above.
    #[inline(always)]
    pub(super) fn add_row<R: Real>(&mut self, row: usize, residuals: &[R], slopes: &[R]) {
        if row.is_multiple_of(TILE) {
            self.end_tiles();
        }
        let rows = residuals.chunks(TILE).zip(slopes.chunks(TILE));
        for ([residual, slope], (residuals, slopes)) in self.sums.iter_mut().zip(rows) {
            *residual += sum(residuals);
            *slope += sum(slopes);
        }
    }

    #[inline(always)]
    fn end_tiles(&mut self) {
        for sums in &mut self.sums {
            let [residual, slope] = std::mem::take(sums);
            if residual != 0.0 {
                // A share that is NaN counts as large.
                let share = 4.0 * residual.abs() / slope;
                self.worst = if share <= self.worst { self.worst } else { share };
            }
        }
    }

    #[inline(always)]
    pub(super) fn finish(mut self) -> f64 {
        self.end_tiles();
        self.worst
    }
}

/// Sums in lanes, in an order independent of the vector width.
#[inline(always)]
fn sum<R: Real>(values: &[R]) -> f64 {
    let mut lanes = [R::default(); 16];
    let chunks = values.chunks_exact(16);
    for (lane, &value) in lanes.iter_mut().zip(chunks.remainder()) {
        *lane += value;
    }
    for chunk in chunks {
        for (lane, &value) in lanes.iter_mut().zip(chunk) {
            *lane += value;
        }
    }
    lanes.into_iter().fold(0.0, |sum, lane| sum + lane.wide())
}
