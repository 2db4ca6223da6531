//! Direction and logarithm of u for the cells of a row.
//!
//! For whole maps, [`Field::direction`] per cell takes several times as long.

use crate::{Cell, Field, Scaled, guidance::SADDLE, real::Real as _, store::Store};

/// Direction and log2 u at the centre of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Policy {
    /// [Direction](Field::direction), a unit vector (along columns, along rows); zero if the cell
    /// has none.
    pub direction: [f64; 2],
    /// log2 u; negative infinity if u is zero.
    pub log2_u: f64,
}

impl Field {
    /// Calls `each` for the cells of `row`, in column order.
    ///
    /// Directions equal those of [`direction`](Self::direction) except for rounding.
    pub fn policy_of_row(&self, row: usize, mut each: impl FnMut(Policy)) {
        let width = self.width();
        assert!(row < self.height());
        let inside = (1..self.height().saturating_sub(1)).contains(&row);
        match &self.store {
            Store::Single(values) if inside => self.of_row(values, -f32::TOP, row, each),
            Store::Double { values, exponent } if inside => {
                self.of_row(values, *exponent, row, each);
            }
            _ => (0..width).for_each(|col| each(self.policy(Cell::new(col, row)))),
        }
    }

    /// Implements [`policy_of_row`](Self::policy_of_row) for a row between two others; `values`
    /// covers all cells.
    fn of_row<T: Copy + Into<f64>>(
        &self,
        values: &[T],
        exponent: i32,
        row: usize,
        mut each: impl FnMut(Policy),
    ) {
        let width = self.width();
        assert_eq!(values.len(), width * self.height());
        let rows = [row - 1, row, row + 1].map(|row| &values[row * width..(row + 1) * width]);
        for col in 0..width {
            each(self.of_cell(rows, exponent, Cell::new(col, row)));
        }
    }

    fn policy(&self, cell: Cell) -> Policy {
        Policy { direction: self.direction(cell).unwrap_or_default(), log2_u: self.u(cell).log2() }
    }

    fn of_cell<T: Copy + Into<f64>>(&self, rows: [&[T]; 3], exponent: i32, cell: Cell) -> Policy {
        let [above, row, below] = rows;
        let col = cell.col;
        let own: f64 = row[col].into();
        let (Some(right), true) = (row.get(col + 1), col > 0) else {
            return self.policy(cell);
        };
        if own <= 0.0 {
            return NONE;
        }
        // Blocked cells are stored as negative values and count as 0.
        let u = |there: T| -> f64 { Into::<f64>::into(there).max(0.0) / own };
        let gradient = [0.5 * (u(*right) - u(row[col - 1])), 0.5 * (u(below[col]) - u(above[col]))];
        let square = gradient[0] * gradient[0] + gradient[1] * gradient[1];
        let plain = square > SADDLE * SADDLE && square.is_finite() && cell != self.target();
        if !plain {
            return self.policy(cell);
        }
        assert!(own > 0.0);
        let length = square.sqrt();
        Policy {
            direction: [gradient[0] / length, gradient[1] / length],
            log2_u: Scaled::new(own, exponent).log2(),
        }
    }
}

const NONE: Policy = Policy { direction: [0.0; 2], log2_u: f64::NEG_INFINITY };
