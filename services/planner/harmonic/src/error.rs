//! Errors of maps and solves, each with its remedy.

use thiserror::Error;

use crate::{Cell, MAX_SIDE, MIN_SCREENING_CELLS};

/// A map is invalid, or a solve has no field.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum SolveError {
    /// The map has no cells.
    #[error("the map is empty ({width} x {height} cells): give it at least one cell")]
    MapEmpty {
        /// Cells along a row.
        width: usize,
        /// Cells along a column.
        height: usize,
    },
    /// The map is wider or higher than [`MAX_SIDE`].
    #[error(
        "the map is too large ({width} x {height} cells): at most {MAX_SIDE} a side; use larger cells"
    )]
    MapTooLarge {
        /// Cells along a row.
        width: usize,
        /// Cells along a column.
        height: usize,
    },
    /// The mask does not have one value for each cell.
    #[error(
        "the blocked mask has {found} values, the map {expected} cells: give one value a cell, row by row"
    )]
    WrongLength {
        /// Values of the mask.
        found: usize,
        /// Cells of the map.
        expected: usize,
    },
    /// A cell was named that the map does not have.
    #[error("{what} (column {}, row {}) lies outside the map of {width} x {height} cells", cell.col, cell.row)]
    Outside {
        /// The cell's part: the target, or a change.
        what: &'static str,
        /// The cell that was named.
        cell: Cell,
        /// Cells along a row.
        width: usize,
        /// Cells along a column.
        height: usize,
    },
    /// The target is on a blocked cell.
    #[error("the target (column {}, row {}) is blocked: choose a free cell or free that one", target.col, target.row)]
    TargetBlocked {
        /// The target that was given.
        target: Cell,
    },
    /// A screening length is not a number or shorter than [`MIN_SCREENING_CELLS`].
    #[error(
        "a screening length of {cells} cells: it must be at least {MIN_SCREENING_CELLS}; an infinite length is no screening"
    )]
    ScreeningLength {
        /// The length found, in cells.
        cells: f64,
    },
    /// The [`Cancellation`](crate::Cancellation) was used.
    #[error("the solve was cancelled")]
    Cancelled,
    /// No method could finish within the memory allowed.
    #[error(
        "no iterative method converged on the map of {width} x {height} cells and the multifrontal factorisation would need \
         at least {needed} bytes, {allowed} are allowed: raise `Settings::memory_limit` or use larger cells"
    )]
    TooCostly {
        /// Bytes the factorisation would need, at least.
        needed: u64,
        /// Bytes the settings allow.
        allowed: u64,
        /// Cells along a row.
        width: usize,
        /// Cells along a column.
        height: usize,
    },
    /// No method produced a field that passes verification; the field is not handed out.
    #[error(
        "the field failed verification (worst relative residual {worst_residual:e}, {local_maxima} cells without a better \
         neighbour): report this map"
    )]
    Unverified {
        /// Worst componentwise relative residual found.
        worst_residual: f64,
        /// Reachable cells without a strictly better neighbour.
        local_maxima: usize,
    },
}
