//! The map a field is solved on: free and blocked cells, the target, the screening.

use crate::cell::{Cell, Change, MAX_SIDE};
use crate::error::SolveError;
use crate::screening::{Coefficients, MIN_SCREENING_CELLS, Screening};

/// A map of `width` x `height` cells with its target and screening, row-major: index = row * width + col.
///
/// Cells outside the map count as blocked, so the rim of a map may be free.
#[derive(Clone, Debug, PartialEq)]
pub struct Domain {
    width: usize,
    height: usize,
    blocked: Vec<bool>,
    screening: Coefficients,
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
            return Err(SolveError::WrongLength {
                what: "the blocked mask",
                found: blocked.len(),
                expected,
            });
        }
        let domain = Self { width, height, blocked, screening: Coefficients::NONE, target };
        if domain.blocked[domain.checked_index(target, "the target")?] {
            return Err(SolveError::TargetBlocked { target });
        }
        Ok(domain)
    }

    /// Replaces the screening.
    ///
    /// # Errors
    /// [`SolveError::WrongLength`] and [`SolveError::ScreeningLength`].
    pub fn with_screening(mut self, screening: &Screening) -> Result<Self, SolveError> {
        let check = |index: usize, cells: f64| {
            if cells >= MIN_SCREENING_CELLS {
                Ok(())
            } else {
                Err(SolveError::ScreeningLength { index, cells })
            }
        };
        match screening {
            Screening::None => {}
            Screening::Uniform { length, cell } => check(0, length / cell)?,
            Screening::PerCell(lengths) => {
                let expected = self.blocked.len();
                if lengths.len() != expected {
                    return Err(SolveError::WrongLength {
                        what: "the screening",
                        found: lengths.len(),
                        expected,
                    });
                }
                for (index, &length) in lengths.iter().enumerate() {
                    check(index, f64::from(length))?;
                }
            }
        }
        self.screening = Coefficients::of(screening);
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

    pub fn width(&self) -> usize {
        self.width
    }

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

    /// The screening coefficient k of the cell with row-major `index`, 0 beyond the map.
    pub fn screening_coefficient(&self, index: usize) -> f64 {
        self.screening.at(index)
    }

    pub(crate) fn screening(&self) -> &Coefficients {
        &self.screening
    }

    /// Row-major index of a cell of the map.
    pub(crate) fn index(&self, cell: Cell) -> usize {
        cell.row * self.width + cell.col
    }

    /// Row-major indices of the neighbours inside the map of the cell with index `index`: west, east, north, south.
    pub fn neighbours(&self, index: usize) -> [Option<usize>; 4] {
        let (width, height) = (self.width, self.height);
        let (col, row) = (index % width, index / width);
        [
            (col > 0).then(|| index - 1),
            (col + 1 < width).then(|| index + 1),
            (row > 0).then(|| index - width),
            (row + 1 < height).then(|| index + width),
        ]
    }

    fn checked_index(&self, cell: Cell, what: &'static str) -> Result<usize, SolveError> {
        if cell.col >= self.width || cell.row >= self.height {
            return Err(SolveError::Outside { what, cell, width: self.width, height: self.height });
        }
        Ok(self.index(cell))
    }
}
