//! A breadth-first pass over the free cells, from the target or from all cells whose u is known.

use super::budget::Budget;
use crate::{Cancellation, Domain, SolveError};

/// The cell has no place in the order: blocked, or cut off from the target.
pub(crate) const ABSENT: u32 = u32::MAX;

/// Distances between two checks of the cancellation: at most some hundred microseconds on the largest maps.
const CHECKED_EVERY: usize = 64;

/// The cells whose u is known and that have others beside them, and the others that can be reached, in order of their distance.
pub(crate) struct BreadthFirst {
    /// Indices into the padded map of the cells by distance, at first those whose u is known, such as the target.
    order: Vec<u32>,
    /// Place in `order` of each cell of the padded map, or [`ABSENT`].
    place: Vec<u32>,
    /// Places at which a new distance starts: distance d takes `level[d] .. level[d + 1]`.
    pub levels: Vec<u32>,
    width: usize,
}

impl BreadthFirst {
    /// Visits `domain` from its target.
    ///
    /// # Errors
    /// [`SolveError::Cancelled`] and [`SolveError::TooCostly`].
    pub(crate) fn from_target(
        domain: &Domain,
        budget: &Budget,
        cancellation: &Cancellation,
    ) -> Result<Self, SolveError> {
        let target = domain.index(domain.target());
        Self::from_known(domain, |index| index == target, budget, cancellation)
    }

    /// Visits the cells of `domain` whose u is not known from those whose u `is_known`, by row-major index.
    ///
    /// # Errors
    /// [`SolveError::Cancelled`] and [`SolveError::TooCostly`].
    pub(crate) fn from_known(
        domain: &Domain,
        is_known: impl Fn(usize) -> bool,
        budget: &Budget,
        cancellation: &Cancellation,
    ) -> Result<Self, SolveError> {
        let (width, height) = (domain.width(), domain.height());
        // The place of each cell and the order of the free ones.
        let entries = (width + 2) * (height + 2) + width * height;
        budget.ask((entries * size_of::<u32>()) as u64)?;
        // A border of absent cells makes it unnecessary to check whether a neighbour exists.
        const UNSEEN: u32 = u32::MAX - 1;
        const KNOWN: u32 = u32::MAX - 2;
        let stride = width + 2;
        let mut place = vec![ABSENT; stride * (height + 2)];
        let mut known = Vec::new();
        let mut free = 0;
        for (row, cells) in domain.blocked().chunks_exact(width).enumerate() {
            let start = (row + 1) * stride + 1;
            for (col, &blocked) in cells.iter().enumerate() {
                if !blocked && is_known(row * width + col) {
                    place[start + col] = KNOWN;
                    known.push((start + col) as u32);
                } else if !blocked {
                    place[start + col] = UNSEEN;
                    free += 1;
                }
            }
        }

        let around = |cell: usize| [cell - stride, cell - 1, cell + 1, cell + stride];
        let is_alone = known.len() == 1;
        let mut order = Vec::with_capacity(free + 1);
        for cell in known {
            let borders = around(cell as usize).iter().any(|&it| place[it] == UNSEEN);
            let at = if is_alone || borders { order.len() as u32 } else { ABSENT };
            place[cell as usize] = at;
            if at != ABSENT {
                order.push(cell);
            }
        }
        let known = order.len();
        let mut levels = vec![0, known as u32];
        let mut next = 0;
        while next < order.len() {
            if levels.len() % CHECKED_EVERY == 0 {
                cancellation.check()?;
            }
            let end = order.len();
            while next < end {
                let cell = order[next] as usize;
                next += 1;
                for neighbour in around(cell) {
                    if place[neighbour] == UNSEEN {
                        place[neighbour] = order.len() as u32;
                        order.push(neighbour as u32);
                    }
                }
            }
            if order.len() > end {
                levels.push(order.len() as u32);
            }
        }
        if order.len() < known + free {
            for slot in &mut place {
                if *slot == UNSEEN {
                    *slot = ABSENT;
                }
            }
        }
        Ok(Self { order, place, levels, width })
    }

    pub(crate) fn unknown(&self) -> std::ops::Range<u32> {
        self.levels[1]..self.len() as u32
    }

    /// Cells with a place.
    pub(crate) fn len(&self) -> usize {
        self.order.len()
    }

    pub(crate) fn cell(&self, place: u32) -> usize {
        let padded = self.order[place as usize];
        let stride = self.width as u32 + 2;
        let (row, col) = (padded / stride - 1, padded % stride - 1);
        row as usize * self.width + col as usize
    }

    pub(crate) fn row(&self, row: usize) -> &[u32] {
        let start = (row + 1) * (self.width + 2) + 1;
        &self.place[start..start + self.width]
    }

    /// Places of the four neighbours of the cell at `place`: west, east, north, south.
    pub(crate) fn neighbours(&self, place: u32) -> [u32; 4] {
        let padded = self.order[place as usize] as usize;
        let stride = self.width + 2;
        [padded - 1, padded + 1, padded - stride, padded + stride]
            .map(|neighbour| self.place[neighbour])
    }

    /// Mean width of the passages, cells, estimated from a sample: between two walls each cell has 2 / width blocked neighbours.
    pub(crate) fn width(&self) -> f64 {
        const EVERY: usize = 16;
        let (mut cells, mut walls) = (0_usize, 0_usize);
        for place in (0..self.len() as u32).step_by(EVERY) {
            cells += 1;
            walls +=
                self.neighbours(place).into_iter().filter(|&neighbour| neighbour == ABSENT).count();
        }
        2.0 * cells as f64 / walls.max(1) as f64
    }
}
