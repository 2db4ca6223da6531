//! Breadth-first pass over the free cells, from the target or from all cells with known u.

use super::Job;
use crate::SolveError;

/// Place of a blocked or cut-off cell.
pub(crate) const ABSENT: u32 = u32::MAX;

/// Distances between cancellation checks: at most some hundred microseconds on the largest maps.
const CHECKED_EVERY: usize = 64;

/// Reachable cells by distance from the known cells that border them.
pub(crate) struct BreadthFirst {
    /// Padded-map indices by distance; cells with known u come first.
    order: Vec<u32>,
    /// Place in `order` of each cell of the padded map, or [`ABSENT`].
    place: Vec<u32>,
    /// First place of each distance: distance d takes `levels[d] .. levels[d + 1]`.
    pub levels: Vec<u32>,
    width: usize,
}

impl BreadthFirst {
    pub(crate) fn from_target(job: Job<'_>) -> Result<Self, SolveError> {
        let target = job.domain.index(job.domain.target());
        Self::from_known(job, |index| index == target)
    }

    /// Visits the cells with unknown u from those that `is_known`, by row-major index.
    pub(crate) fn from_known(
        job: Job<'_>,
        is_known: impl Fn(usize) -> bool,
    ) -> Result<Self, SolveError> {
        let domain = job.domain;
        let (width, height) = (domain.width(), domain.height());
        let entries = (width + 2) * (height + 2) + width * height;
        job.ask((entries * size_of::<u32>()) as u64)?;
        // A border of absent cells makes bounds checks for neighbours unnecessary.
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
                job.cancellation.check()?;
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
        assert!(order.len() <= known + free);
        assert_eq!(levels.last().copied(), Some(order.len() as u32));
        debug_assert!(levels.is_sorted());
        debug_assert!((0..).zip(&order).all(|(at, cell)| place[*cell as usize] == at));
        Ok(Self { order, place, levels, width })
    }

    pub(crate) fn unknown(&self) -> std::ops::Range<u32> {
        self.levels[1]..self.len() as u32
    }

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

    /// Returns the places of the west, east, north and south neighbours.
    pub(crate) fn neighbours(&self, place: u32) -> [u32; 4] {
        let padded = self.order[place as usize] as usize;
        let stride = self.width + 2;
        [padded - 1, padded + 1, padded - stride, padded + stride]
            .map(|neighbour| self.place[neighbour])
    }

    /// Estimates the mean width of the passages, in cells, from a sample.
    ///
    /// Between two walls, each cell has 2 / width blocked neighbours.
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
