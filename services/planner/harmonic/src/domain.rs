//! The map a field is solved on: free and blocked cells, the target, the screening.

use crate::{Cell, Change, MAX_SIDE, MIN_SCREENING_CELLS, Screening, SolveError, real::Real};

/// A map of `width` x `height` cells with its target and screening, row-major: index = row * width + col.
///
/// Cells outside the map count as blocked, so the rim of a map may be free.
#[derive(Clone, Debug, PartialEq)]
pub struct Domain {
    width: usize,
    height: usize,
    blocked: Vec<bool>,
    /// The screening coefficient k of cells that cost 1.
    screening: f64,
    /// The cost of each cell; none where all cost 1.
    costs: Vec<f32>,
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
        let domain = Self { width, height, blocked, screening: 0.0, costs: Vec::new(), target };
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
            check_length(length / cell)?;
        }
        self.screening = screening.coefficient();
        Ok(self)
    }

    /// Makes some cells dearer than others: the screening length of a cell is that of the map divided by its cost. In the limit
    /// of short screening lengths the field leads along the way of the least sum of costs; without screening costs change nothing.
    /// Row-major, from 0 on; they are checked against the screening that the map has by then.
    ///
    /// # Errors
    /// [`SolveError::WrongLength`], and [`SolveError::ScreeningLength`] for a cost that is not a number or makes a length too short.
    pub fn with_costs(mut self, costs: Vec<f32>) -> Result<Self, SolveError> {
        let expected = self.blocked.len();
        if costs.len() != expected {
            return Err(SolveError::WrongLength { found: costs.len(), expected });
        }
        let length = 0.5 / self.screening.sqrt();
        costs.iter().try_for_each(|&cost| check_length(length / f64::from(cost)))?;
        self.costs = costs;
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

    /// The screening coefficient k of cells that cost 1.
    pub fn screening_coefficient(&self) -> f64 {
        self.screening
    }

    /// The screening coefficient k of the cell with this row-major index.
    pub fn screening_of(&self, index: usize) -> f64 {
        self.costs
            .get(index)
            .map_or(self.screening, |&cost| self.screening * f64::from(cost).powi(2))
    }

    /// The root mean square over the free cells of 1 / L, as a screening coefficient.
    pub(crate) fn mean_screening(&self) -> f64 {
        if self.costs.is_empty() {
            return self.screening;
        }
        let free = self.blocked.iter().enumerate().filter(|(_, is_blocked)| !**is_blocked);
        let (sum, count) = free
            .fold((0.0, 0), |(sum, count), (index, _)| (sum + self.screening_of(index), count + 1));
        sum / f64::from(count.max(1))
    }

    pub(crate) fn costs(&self) -> &[f32] {
        &self.costs
    }

    /// 0.25 / (1 + k) of the cells of a row.
    pub(crate) fn weights_of_row<R: Real>(&self, row: usize, into: &mut [R]) {
        let width = self.width;
        match self.costs.get(row * width..(row + 1) * width) {
            Some(costs) => {
                let (quarter, k) = (R::of(0.25), R::of(self.screening));
                for (weight, &cost) in into.iter_mut().zip(costs) {
                    let cost = R::of(f64::from(cost));
                    *weight = quarter * (R::ONE + k * cost * cost).inverse();
                }
            }
            None => into.fill(R::of(0.25 / (1.0 + self.screening))),
        }
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

fn check_length(cells: f64) -> Result<(), SolveError> {
    if cells.is_nan() || cells < MIN_SCREENING_CELLS {
        return Err(SolveError::ScreeningLength { cells });
    }
    Ok(())
}
