//! The harmonic field: u of every cell, and the result of its verification.

use crate::{
    Cell, Domain, Method, Scaled,
    store::{BLOCKED, Store},
    verification::{Check, Verification},
};

/// The field of one domain: u = 1 at the target, 0 where blocked or cut off, positive wherever the target can be reached.
///
/// Row-major, as [`Domain`]; cells outside the map count as blocked.
#[derive(Clone, Debug)]
pub struct Field {
    width: usize,
    height: usize,
    target: Cell,
    pub(crate) store: Store,
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

    /// Cells along a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Cells along a column.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The target the field leads to.
    pub fn target(&self) -> Cell {
        self.target
    }

    /// What the check of every cell found.
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

    /// Replaces u of every reachable cell but the target, which must not become zero: a fault injected on purpose, to see the effects
    /// of a wrong field. The [`verification`](Self::verification) no longer holds.
    pub fn overwrite(&mut self, u: impl Fn(Cell) -> Scaled) {
        let raw = |index: usize| {
            let cell = Cell::new(index % self.width, index / self.width);
            let is_replaced = self.is_reachable(cell) && cell != self.target;
            let u = if is_replaced { u(cell) } else { self.store.u(index) };
            (if self.is_blocked(cell) { BLOCKED } else { u.mantissa }, u.exponent)
        };
        let (mantissas, exponents) = (0..self.width * self.height).map(raw).unzip();
        self.store = Store::Extended { mantissas, exponents };
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

    /// u at a signed column and row: zero outside the map.
    pub(crate) fn u_at(&self, col: i64, row: i64) -> Scaled {
        match (usize::try_from(col), usize::try_from(row)) {
            (Ok(col), Ok(row)) => self.u(Cell { col, row }),
            _ => Scaled::ZERO,
        }
    }
}
