use crate::{Cell, Field, Guidance, guidance::add_scaled};

const STEP: f64 = 0.25;
/// Limit of steps within one cell; six steps cross it.
const MOST_STEPS: usize = 8;

impl Field {
    /// Returns the positions along [`guidance`](Self::guidance) from the centre of `start` to the
    /// centre of the target.
    ///
    /// Positions are (column, row) in cells, in steps of a quarter of a cell. Returns `None` if
    /// `start` cannot reach the target.
    ///
    /// u grows from each cell of the path to the next, so the path ends. A step to a smaller u or
    /// across a blocked cell goes to the centre of the neighbour with the largest u instead.
    pub fn path(&self, start: Cell) -> Option<Vec<[f64; 2]>> {
        if !self.is_reachable(start) {
            return None;
        }
        let (mut cell, mut steps) = ((start.col as i64, start.row as i64), 0);
        let mut at = [start.col as f64, start.row as f64];
        let mut path = vec![at];
        while let Guidance::Along(direction) = self.guidance(at[0], at[1]) {
            let ahead = add_scaled(at, STEP, direction);
            let next = (ahead[0].round() as i64, ahead[1].round() as i64);
            let stays = next == cell && steps < MOST_STEPS;
            let u = |place| self.u_at(place);
            // A diagonal step must not cut the corner of a blocked cell.
            let cuts = u((next.0, cell.1)).is_zero() || u((cell.0, next.1)).is_zero();
            if stays || u(next) > u(cell) && !cuts {
                (at, cell) = (ahead, next);
                steps = if stays { steps + 1 } else { 0 };
            } else {
                let [right, down] = self.steepest_ascent(cell);
                let best = (cell.0 + right, cell.1 + down);
                assert!(u(best) > u(cell), "the field has no maximum");
                cell = best;
                (at, steps) = ([cell.0 as f64, cell.1 as f64], 0);
            }
            path.push(at);
        }
        path.push([self.target().col as f64, self.target().row as f64]);
        Some(path)
    }
}
