use crate::{Cell, Change, MAX_SIDE, MIN_SCREENING_CELLS, Screening, SolveError, real::Real};

/// Map of `width` x `height` cells with its target, screening and costs. Cells outside count as
/// blocked.
#[derive(Clone, Debug, PartialEq)]
pub struct Domain {
    width: usize,
    height: usize,
    blocked: Vec<bool>,
    screening: f64,
    /// Empty if all costs are 1.
    costs: Vec<f32>,
    target: Cell,
}

impl Domain {
    /// Creates a map without screening.
    ///
    /// `blocked` is row-major, with `width * height` values.
    ///
    /// # Errors
    /// - [`SolveError::MapEmpty`] if a side is 0.
    /// - [`SolveError::MapTooLarge`] if a side exceeds [`MAX_SIDE`] cells.
    /// - [`SolveError::WrongLength`] if the length of `blocked` differs from `width * height`.
    /// - [`SolveError::Outside`] if the target lies outside the map.
    /// - [`SolveError::TargetBlocked`] if the target is blocked.
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

    /// Replaces the screening, and with it the coefficient k of every cell.
    ///
    /// # Errors
    /// [`SolveError::ScreeningLength`] if the length is NaN or below [`MIN_SCREENING_CELLS`].
    pub fn with_screening(mut self, screening: &Screening) -> Result<Self, SolveError> {
        check_length(screening.length / screening.cell)?;
        self.screening = screening.coefficient();
        assert!(self.screening >= 0.0 && self.screening.is_finite());
        Ok(self)
    }

    /// Sets the cost of each cell: the screening length of a cell becomes that of the map divided
    /// by its cost.
    ///
    /// `costs` is row-major, with values from 0 up. For short screening lengths, the field
    /// approaches the path with the least sum of costs. Without screening, costs have no effect.
    /// Call [`with_screening`](Self::with_screening) first.
    ///
    /// # Errors
    /// - [`SolveError::WrongLength`] if the length of `costs` differs from the number of cells.
    /// - [`SolveError::ScreeningLength`] if a cost is NaN or negative, or makes a length shorter
    ///   than [`MIN_SCREENING_CELLS`].
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
    /// An error leaves the map unchanged.
    ///
    /// # Errors
    /// - [`SolveError::Outside`] if a cell lies outside the map.
    /// - [`SolveError::TargetBlocked`] if a change blocks the target.
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
        assert!(!self.is_blocked(self.target));
        Ok(())
    }

    /// Returns the number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns the cell of the target, which is free.
    pub fn target(&self) -> Cell {
        self.target
    }

    /// Returns the mask of blocked cells, row-major.
    pub fn blocked(&self) -> &[bool] {
        &self.blocked
    }

    /// Returns whether `cell` is blocked or outside the map.
    pub fn is_blocked(&self, cell: Cell) -> bool {
        cell.col >= self.width || cell.row >= self.height || self.blocked[self.index(cell)]
    }

    /// Returns the screening coefficient k of cells with cost 1: (h / (2 L))^2 for cells of side h.
    pub fn screening_coefficient(&self) -> f64 {
        self.screening
    }

    /// Returns the screening coefficient k of the cell at row-major `index`: the map's k times the
    /// squared cost.
    pub fn screening_of(&self, index: usize) -> f64 {
        self.costs
            .get(index)
            .map_or(self.screening, |&cost| self.screening * f64::from(cost).powi(2))
    }

    /// Returns the root mean square of 1 / L over the free cells, as a screening coefficient.
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

    /// Writes 0.25 / (1 + k) of each cell of a row.
    pub(crate) fn weights_of_row<R: Real>(&self, row: usize, into: &mut [R]) {
        assert_eq!(into.len(), self.width);
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

    pub(crate) fn index(&self, cell: Cell) -> usize {
        debug_assert!(cell.col < self.width && cell.row < self.height);
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
