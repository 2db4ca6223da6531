//! The map a field is solved on: free and blocked cells, the target, the screening.

use crate::{Cell, Change, MAX_SIDE, MIN_SCREENING_CELLS, Screening, SolveError};

/// A map of `width` x `height` cells with its target and screening, row-major: index = row * width + col.
///
/// Cells outside the map count as blocked, so the rim of a map may be free.
#[derive(Clone, Debug, PartialEq)]
pub struct Domain {
    width: usize,
    height: usize,
    blocked: Vec<bool>,
    /// The screening coefficient k of all cells.
    screening: f64,
    target: Cell,
}

impl Domain {
    /// A map without screening. `blocked` is row-major.
    ///
    /// # Errors
    /// [`SolveError::MapEmpty`], [`SolveError::MapTooLarge`], [`SolveError::WrongLength`], [`SolveError::Outside`] and
    /// [`SolveError::TargetBlocked`].
    pub fn new(
        width: usize,
        height: usize,
        blocked: Vec<bool>,
        target: Cell,
    ) -> Result<Self, SolveError> {
        if width == 0 || height == 0 {
            return Err(SolveError::MapEmpty { width, height });
        }
        if width > MAX_SIDE || height > MAX_SIDE {
            return Err(SolveError::MapTooLarge { width, height });
        }
        let expected = width * height;
        if blocked.len() != expected {
            return Err(SolveError::WrongLength { found: blocked.len(), expected });
        }
        let domain = Self { width, height, blocked, screening: 0.0, target };
        if domain.blocked[domain.checked_index(target, "the target")?] {
            return Err(SolveError::TargetBlocked { target });
        }
        Ok(domain)
    }

    /// Replaces the screening.
    ///
    /// # Errors
    /// [`SolveError::ScreeningLength`].
    pub fn with_screening(mut self, screening: &Screening) -> Result<Self, SolveError> {
        if let Screening::Uniform { length, cell } = screening {
            let cells = length / cell;
            if cells.is_nan() || cells < MIN_SCREENING_CELLS {
                return Err(SolveError::ScreeningLength { cells });
            }
        }
        self.screening = screening.coefficient();
        Ok(self)
    }

    /// Blocks or frees cells.
    ///
    /// # Errors
    /// [`SolveError::Outside`], and [`SolveError::TargetBlocked`] when the target itself would be blocked; the map is
    /// then unchanged.
    pub fn apply(&mut self, changes: &[Change]) -> Result<(), SolveError> {
        for change in changes {
            self.checked_index(change.cell, "a changed cell")?;
            if change.blocked && change.cell == self.target {
                return Err(SolveError::TargetBlocked { target: self.target });
            }
        }
        for change in changes {
            let index = self.index(change.cell);
            self.blocked[index] = change.blocked;
        }
        Ok(())
    }

    /// Cells along a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Cells along a column.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The target's cell; it is free.
    pub fn target(&self) -> Cell {
        self.target
    }

    /// The mask of blocked cells, row-major.
    pub fn blocked(&self) -> &[bool] {
        &self.blocked
    }

    /// Whether `cell` is blocked or outside the map.
    pub fn is_blocked(&self, cell: Cell) -> bool {
        cell.col >= self.width || cell.row >= self.height || self.blocked[self.index(cell)]
    }

    /// The screening coefficient k.
    pub fn screening_coefficient(&self) -> f64 {
        self.screening
    }

    /// Row-major index of a cell of the map.
    pub(crate) fn index(&self, cell: Cell) -> usize {
        cell.row * self.width + cell.col
    }

    fn checked_index(&self, cell: Cell, what: &'static str) -> Result<usize, SolveError> {
        if cell.col >= self.width || cell.row >= self.height {
            return Err(SolveError::Outside { what, cell, width: self.width, height: self.height });
        }
        Ok(self.index(cell))
    }
}
