//! The way along the field from a cell to the target.

use crate::{Cell, Field, Guidance};

/// Length of a step, in cells.
const STEP: f64 = 0.25;
/// Most steps in one cell: it is crossed in six.
const MOST_STEPS: usize = 8;

impl Field {
    /// The positions of one who follows the [guidance](Self::guidance) from the centre of `start` to that of the target, in
    /// steps of a quarter of a cell; none if no path leads there.
    ///
    /// u grows from each of its cells to the next, so it ends: where a step would lead to a smaller u or touch a blocked cell, it
    /// goes to the neighbour with the largest.
    pub fn path(&self, start: Cell) -> Option<Vec<[f64; 2]>> {
        if !self.is_reachable(start) {
            return None;
        }
        let (mut cell, mut steps) = ((start.col as i64, start.row as i64), 0);
        let mut at = [start.col as f64, start.row as f64];
        let mut path = vec![at];
        while let Guidance::Along([x, y]) = self.guidance(at[0], at[1]) {
            let ahead = [at[0] + STEP * x, at[1] + STEP * y];
            let next = (ahead[0].round() as i64, ahead[1].round() as i64);
            let stays = next == cell && steps < MOST_STEPS;
            let u = |col, row| self.u_at(col, row);
            // A step to a diagonal neighbour must not cut the corner of a blocked cell.
            let cuts = u(next.0, cell.1).is_zero() || u(cell.0, next.1).is_zero();
            if stays || u(next.0, next.1) > u(cell.0, cell.1) && !cuts {
                (at, cell) = (ahead, next);
                steps = if stays { steps + 1 } else { 0 };
            } else {
                let [right, down] = self.steepest_ascent(cell.0, cell.1);
                cell = (cell.0 + right, cell.1 + down);
                (at, steps) = ([cell.0 as f64, cell.1 as f64], 0);
            }
            path.push(at);
        }
        path.push([self.target().col as f64, self.target().row as f64]);
        Some(path)
    }
}
