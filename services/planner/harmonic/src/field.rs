//! Harmonic field: u of every cell, and the result of its verification.

use crate::{
    Cell, Domain, Method, Scaled,
    store::{BLOCKED, Store},
    verification::{Check, Verification},
};

/// Column and row of a cell, negative or beyond the last outside the map.
pub(crate) type Place = (i64, i64);

/// Returns the cell at `place`; a negative index gives one outside every map.
pub(crate) fn cell_at((col, row): Place) -> Cell {
    let index = |at: i64| usize::try_from(at).unwrap_or(usize::MAX);
    Cell { col: index(col), row: index(row) }
}

/// Verified field of one [`Domain`].
///
/// u is 1 at the target, 0 in blocked and cut-off cells, and positive in every cell that can reach
/// the target. Cells outside the map count as blocked.
#[derive(Clone, Debug)]
pub struct Field {
    width: usize,
    height: usize,
    target: Cell,
    pub(crate) store: Store,
    verification: Verification,
}

impl Field {
    pub(crate) fn new(domain: &Domain, store: Store, check: &Check, method: Method) -> Self {
        assert!(check.holds() && check.reachable > 0);
        assert_eq!(store.u(domain.index(domain.target())), Scaled::ONE);
        debug_assert!(domain.blocked().iter().enumerate().all(|(index, is_blocked)| {
            // The maximum principle: u is greatest at the target.
            *is_blocked == (store.raw(index).0 < 0.0) && store.u(index) <= Scaled::ONE
        }));
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

    /// Returns the number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns the target of the field.
    pub fn target(&self) -> Cell {
        self.target
    }

    /// Returns the findings of the check.
    pub fn verification(&self) -> &Verification {
        &self.verification
    }

    /// Returns u of `cell`, from 0 to 1.
    ///
    /// u is 0 in cells that are blocked, cut off from the target or outside the map.
    pub fn u(&self, cell: Cell) -> Scaled {
        if cell.col >= self.width || cell.row >= self.height {
            return Scaled::ZERO;
        }
        self.store.u(cell.row * self.width + cell.col)
    }

    /// Replaces u of every reachable cell except the target: injects a fault to test the effects of
    /// a wrong field.
    ///
    /// `u` must return positive values. The [`verification`](Self::verification) no longer applies
    /// afterwards.
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

    /// Returns whether `cell` can reach the target.
    pub fn is_reachable(&self, cell: Cell) -> bool {
        !self.u(cell).is_zero()
    }

    /// Returns whether `cell` was blocked during the solve or lies outside the map.
    pub fn is_blocked(&self, cell: Cell) -> bool {
        cell.col >= self.width
            || cell.row >= self.height
            || self.store.raw(cell.row * self.width + cell.col).0 < 0.0
    }

    /// Returns log10 of the smallest u of a reachable cell, to compare with the range of
    /// floating-point numbers.
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

    pub(crate) fn steepest_ascent(&self, (col, row): Place) -> [i64; 2] {
        let mut best = (Scaled::ZERO, [0; 2]);
        for (dc, dr) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
            let u = self.u_at((col + dc, row + dr));
            if u > best.0 {
                best = (u, [dc, dr]);
            }
        }
        best.1
    }

    pub(crate) fn fits(&self, domain: &Domain) -> bool {
        (self.width, self.height, self.target) == (domain.width(), domain.height(), domain.target())
    }

    /// Returns 0 outside the map.
    pub(crate) fn u_at(&self, place: Place) -> Scaled {
        self.u(cell_at(place))
    }
}
