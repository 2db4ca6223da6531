//! Errors of maps and solves; each message names its remedy.

use thiserror::Error;

use crate::{Cell, MAX_SIDE, MIN_SCREENING_CELLS};

/// Reason why a map is invalid or a solve has no field.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum SolveError {
    /// Map without cells.
    #[error("the map is empty ({width} x {height} cells); give it at least one cell")]
    MapEmpty {
        /// Columns of the map.
        width: usize,
        /// Rows of the map.
        height: usize,
    },
    /// Map wider or higher than [`MAX_SIDE`] cells.
    #[error(
        "the map is too large ({width} x {height} cells, at most {MAX_SIDE} a side); use larger cells"
    )]
    MapTooLarge {
        /// Columns of the map.
        width: usize,
        /// Rows of the map.
        height: usize,
    },
    /// Mask or cost array whose length differs from the number of cells.
    #[error(
        "the blocked mask has {found} values, but the map has {expected} cells; give one value per cell, row by row"
    )]
    WrongLength {
        /// Values found.
        found: usize,
        /// Values expected, one per cell.
        expected: usize,
    },
    /// Cell outside the map.
    #[error("{what} (column {}, row {}) lies outside the map of {width} x {height} cells", cell.col, cell.row)]
    Outside {
        /// Role of the cell: the target or a changed cell.
        what: &'static str,
        /// Cell outside the map.
        cell: Cell,
        /// Columns of the map.
        width: usize,
        /// Rows of the map.
        height: usize,
    },
    /// Target on a blocked cell.
    #[error("the target (column {}, row {}) is blocked; choose a free cell, or free that one", target.col, target.row)]
    TargetBlocked {
        /// Target given.
        target: Cell,
    },
    /// Screening length that is NaN or shorter than [`MIN_SCREENING_CELLS`].
    #[error(
        "the screening length of {cells} cells is too short; give at least {MIN_SCREENING_CELLS}, or infinity to disable screening"
    )]
    ScreeningLength {
        /// Length found, in cells.
        cells: f64,
    },
    /// Solve stopped by its [`Cancellation`](crate::Cancellation).
    #[error("the solve was cancelled")]
    Cancelled,
    /// Solve that exceeds the memory limit.
    ///
    /// Every iterative method failed, and the multifrontal factorisation needs more memory than
    /// allowed.
    #[error(
        "no iterative method converged on the map of {width} x {height} cells and the multifrontal factorisation needs \
         at least {needed} of {allowed} allowed bytes; raise `Settings::memory_limit` or use larger cells"
    )]
    TooCostly {
        /// Least memory that the factorisation needs, in bytes.
        needed: u64,
        /// Memory allowed by [`Settings::memory_limit`](crate::Settings::memory_limit), in bytes.
        allowed: u64,
        /// Columns of the map.
        width: usize,
        /// Rows of the map.
        height: usize,
    },
    /// Field of the last method failed verification; the solver discards it.
    #[error(
        "the field failed verification (worst relative residual {worst_residual:e}, {local_maxima} cells without a better \
         neighbour); report this map"
    )]
    Unverified {
        /// Largest residual found, relative to u of its cell.
        worst_residual: f64,
        /// Free cells that no neighbour exceeds, and cells of u = 0 beside a cell of u > 0.
        local_maxima: usize,
    },
}
