//! The harmonic field: u of every cell, and the result of its verification.

use crate::cell::Cell;
use crate::domain::Domain;
use crate::method::Method;
use crate::scaled::Scaled;
use crate::store::Store;
use crate::verification::{Check, Verification};

/// The field of one domain: u = 1 at the target, 0 where blocked or cut off, positive wherever the target can be reached.
///
/// Row-major, as [`Domain`]; cells outside the map count as blocked.
#[derive(Clone, Debug)]
pub struct Field {
    width: usize,
    height: usize,
    target: Cell,
    store: Store,
    verification: Verification,
}

impl Field {
    /// The field of `domain` that `method` computed, with the result of its check.
    pub(crate) fn new(domain: &Domain, store: Store, check: &Check, method: Method) -> Self {
        Self {
            width: domain.width(),
            height: domain.height(),
            target: domain.target(),
            store,
            verification: Verification {
                worst_residual: check.worst_residual,
                worst_tile: check.worst_tile,
                method,
                reachable: check.reachable,
            },
        }
    }

    pub fn width(&self) -> usize {
        self.width
    }

    pub fn height(&self) -> usize {
        self.height
    }

    /// The target the field leads to.
    pub fn target(&self) -> Cell {
        self.target
    }

    pub fn verification(&self) -> &Verification {
        &self.verification
    }

    /// u of `cell`; zero where blocked, cut off from the target, or outside the map.
    pub fn u(&self, cell: Cell) -> Scaled {
        if cell.col >= self.width || cell.row >= self.height {
            return Scaled::ZERO;
        }
        self.store.u(cell.row * self.width + cell.col)
    }

    /// Replaces u of a reachable cell by `u`, which must not be zero: a fault injected on purpose, to see the effects of
    /// a wrong field. Other cells are left as they are. The [`verification`](Self::verification) no longer holds.
    pub fn overwrite(&mut self, cell: Cell, u: Scaled) {
        if self.is_reachable(cell) && !u.is_zero() {
            let index = cell.row * self.width + cell.col;
            self.store.set(index, u.mantissa, u.exponent);
        }
    }

    /// Whether the target can be reached from `cell`.
    pub fn is_reachable(&self, cell: Cell) -> bool {
        !self.u(cell).is_zero()
    }

    /// Whether `cell` was blocked when the field was computed, or lies outside the map.
    pub fn is_blocked(&self, cell: Cell) -> bool {
        cell.col >= self.width
            || cell.row >= self.height
            || self.store.raw(cell.row * self.width + cell.col).0 < 0.0
    }

    /// log10 of the smallest u of a reachable cell: how far below the range of a floating-point number the field goes.
    pub fn log10_u_min(&self) -> f64 {
        let mut least = Scaled::ONE;
        for index in 0..self.width * self.height {
            let u = self.store.u(index);
            if !u.is_zero() && u < least {
                least = u;
            }
        }
        least.log10()
    }

    /// The neighbour with the largest u as seen from `cell`, `None` where u is zero and at the target.
    ///
    /// This is steepest ascent cell by cell; it ends at the target from every reachable cell.
    pub fn ascent(&self, cell: Cell) -> Option<Cell> {
        if cell == self.target || !self.is_reachable(cell) {
            return None;
        }
        let (col, row) = (cell.col as i64, cell.row as i64);
        let [dc, dr] = self.steepest_ascent(col, row);
        Some(Cell::new((col + dc) as usize, (row + dr) as usize))
    }

    /// The step, along columns or rows, to the neighbour with the largest u.
    pub(crate) fn steepest_ascent(&self, col: i64, row: i64) -> [i64; 2] {
        let mut best = (Scaled::ZERO, [0; 2]);
        for (dc, dr) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
            let u = self.u_at(col + dc, row + dr);
            if u > best.0 {
                best = (u, [dc, dr]);
            }
        }
        best.1
    }

    /// Whether this is a field of a map of the same size and the same target.
    pub(crate) fn fits(&self, domain: &Domain) -> bool {
        (self.width, self.height, self.target) == (domain.width(), domain.height(), domain.target())
    }

    pub(crate) fn store(&self) -> &Store {
        &self.store
    }

    /// u at a signed column and row: zero outside the map.
    pub(crate) fn u_at(&self, col: i64, row: i64) -> Scaled {
        match (usize::try_from(col), usize::try_from(row)) {
            (Ok(col), Ok(row)) => self.u(Cell { col, row }),
            _ => Scaled::ZERO,
        }
    }
}
