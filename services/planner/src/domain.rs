//! The map a field is solved on: free and blocked cells, the target, the absorption.

use crate::error::SolveError;

/// Longest side of a map, in cells.
pub const MAX_SIDE: usize = 16_384;

/// Largest absorption of a cell. One cell of it lets a walk survive once in a million: more is a blocked cell.
pub const MAX_ABSORPTION: f64 = 1e6;

/// A cell of the map.
#[derive(Clone, Copy, Debug, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub struct Cell {
    /// Column, from 0.
    pub col: usize,
    /// Row, from 0.
    pub row: usize,
}

impl Cell {
    /// The cell of column `col` and row `row`.
    pub const fn new(col: usize, row: usize) -> Self {
        Self { col, row }
    }
}

/// A cell that became blocked or free since the field was solved.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct Change {
    /// The cell.
    pub cell: Cell,
    /// Whether it is blocked from now on.
    pub blocked: bool,
}

/// The share of random walks that die in a cell: u = (mean of the four neighbours) / (1 + k).
#[derive(Clone, Debug, PartialEq)]
pub enum Absorption {
    /// The same k in every cell; 0 is equation (11) as printed.
    Uniform(f64),
    /// One k a cell, row-major.
    PerCell(Vec<f32>),
}

/// A map of `width` x `height` cells with its target and absorption, row-major: index = row * width + col.
///
/// Cells outside the map count as blocked, so the rim of a map need not be.
#[derive(Clone, Debug, PartialEq)]
pub struct Domain {
    width: usize,
    height: usize,
    blocked: Vec<bool>,
    absorption: Absorption,
    target: Cell,
}

impl Domain {
    /// A map with no absorption. `blocked` is row-major.
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
        let mut domain = Self {
            width,
            height,
            blocked,
            absorption: Absorption::Uniform(0.0),
            target,
        };
        domain.set_target(target)?;
        Ok(domain)
    }

    /// The same map with another absorption.
    ///
    /// # Errors
    /// [`SolveError::WrongLength`] and [`SolveError::Absorption`].
    pub fn with_absorption(mut self, absorption: Absorption) -> Result<Self, SolveError> {
        let valid = |k: f64| (0.0..=MAX_ABSORPTION).contains(&k);
        match &absorption {
            Absorption::Uniform(k) if !valid(*k) => {
                return Err(SolveError::Absorption {
                    index: 0,
                    value: *k,
                });
            }
            Absorption::Uniform(_) => {}
            Absorption::PerCell(cells) => {
                let expected = self.blocked.len();
                if cells.len() != expected {
                    return Err(SolveError::WrongLength {
                        what: "the absorption",
                        found: cells.len(),
                        expected,
                    });
                }
                if let Some(index) = cells.iter().position(|&k| !valid(f64::from(k))) {
                    return Err(SolveError::Absorption {
                        index,
                        value: f64::from(cells[index]),
                    });
                }
            }
        }
        self.absorption = absorption;
        Ok(self)
    }

    /// Moves the target.
    ///
    /// # Errors
    /// [`SolveError::Outside`] and [`SolveError::TargetBlocked`]; the target then stays where it was.
    pub fn set_target(&mut self, target: Cell) -> Result<(), SolveError> {
        let index = self.checked_index(target, "the target")?;
        if self.blocked[index] {
            return Err(SolveError::TargetBlocked { target });
        }
        self.target = target;
        Ok(())
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
                return Err(SolveError::TargetBlocked {
                    target: self.target,
                });
            }
        }
        for change in changes {
            let index = self.index(change.cell);
            self.blocked[index] = change.blocked;
        }
        Ok(())
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
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

    /// The absorption as it was given.
    pub fn absorption(&self) -> &Absorption {
        &self.absorption
    }

    /// The absorption k of the cell with row-major `index`, 0 beyond the map.
    pub fn absorption_at(&self, index: usize) -> f64 {
        match &self.absorption {
            Absorption::Uniform(k) => *k,
            Absorption::PerCell(cells) => cells.get(index).copied().map_or(0.0, f64::from),
        }
    }

    /// Row-major index of a cell known to lie inside the map.
    pub(crate) fn index(&self, cell: Cell) -> usize {
        cell.row * self.width + cell.col
    }

    fn checked_index(&self, cell: Cell, what: &'static str) -> Result<usize, SolveError> {
        if cell.col >= self.width || cell.row >= self.height {
            return Err(SolveError::Outside {
                what,
                cell,
                width: self.width,
                height: self.height,
            });
        }
        Ok(self.index(cell))
    }
}
