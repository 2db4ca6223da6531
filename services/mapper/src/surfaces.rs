//! Surfaces that scans showed, and the nearest one to a place.

use glam::DVec2;
use serde::{Deserialize, Serialize};

/// Side of a cell, and the farthest search, metres.
pub(crate) const CELL_M: f64 = 0.5;

/// A piece of a line: one keyframe's points on one line, in the mission frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Surface {
    pub at: DVec2,
    pub normal: DVec2,
    /// Travel when last seen, metres.
    pub seen_m: f64,
}

/// Surfaces by square cells, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Index {
    origin: DVec2,
    width: usize,
    /// Number of surfaces before each cell, and in all.
    before: Vec<u32>,
    surfaces: Vec<u32>,
}

impl Index {
    pub(crate) fn new(surfaces: &[Surface]) -> Self {
        let corner = |pick: fn(DVec2, DVec2) -> DVec2| {
            surfaces.iter().map(|surface| surface.at).reduce(pick).unwrap_or_default()
        };
        let origin = corner(DVec2::min) - CELL_M;
        let cells = ((corner(DVec2::max) - origin) / CELL_M).floor() + 2.0;
        let width = cells.x as usize;
        let height = cells.y as usize;
        let mut index =
            Self { origin, width, before: vec![0; width * height + 1], surfaces: Vec::new() };
        let mut order: Vec<_> =
            (0_u32..).zip(surfaces).map(|(number, it)| (index.cell(it.at), number)).collect();
        order.sort_unstable();
        for (cell, _) in &order {
            index.before[cell + 1] += 1;
        }
        for cell in 1..index.before.len() {
            index.before[cell] += index.before[cell - 1];
        }
        index.surfaces = order.into_iter().map(|(_, number)| number).collect();
        index
    }

    fn cell(&self, at: DVec2) -> usize {
        let cell = (at - self.origin) / CELL_M;
        cell.y as usize * self.width + cell.x as usize
    }

    /// Returns whether it was never built.
    pub(crate) const fn is_empty(&self) -> bool {
        self.before.is_empty()
    }

    /// Returns the number of the nearest surface within `gate` metres, at most [`CELL_M`].
    pub(crate) fn nearest(&self, surfaces: &[Surface], at: DVec2, gate: f64) -> Option<usize> {
        debug_assert!(gate <= CELL_M);
        let [low, high] = [-gate, gate].map(|way| (at + way - self.origin) / CELL_M);
        let height = (self.before.len() - 1) / self.width.max(1);
        let [left, bottom] = [low.x, low.y].map(|it| it.max(0.0) as usize);
        // A negative float becomes 0, whose margin of one cell is empty.
        let (right, top) =
            ((high.x as usize).min(self.width - 1), (high.y as usize).min(height - 1));
        if left > right {
            return None;
        }
        let mut nearest = None;
        let mut square = gate * gate;
        for row in bottom..=top {
            let row = row * self.width;
            let found = self.before[row + left] as usize..self.before[row + right + 1] as usize;
            for number in &self.surfaces[found] {
                let other = surfaces[*number as usize].at.distance_squared(at);
                if other <= square {
                    nearest = Some(*number as usize);
                    square = other;
                }
            }
        }
        nearest
    }
}
