//! Cells within reach of an occupied cell, which the body's centre must not enter.

use common::grid::{Cell, GridFrame, Window};
use glam::DVec2;

use crate::evidence_grid::Flip;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Geometry {
    pub(crate) lattice: GridFrame,
    pub(crate) grid: GridFrame,
    /// An occupied cell blocks up to here, centre to centre, metres.
    pub(crate) reach: f64,
}

/// Occupied lattice cells within reach of each grid cell, row-major.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Inflation {
    count: Vec<u16>,
}

impl Inflation {
    pub(crate) fn new(geometry: &Geometry) -> Self {
        Self { count: vec![0; geometry.grid.area()] }
    }

    pub(crate) fn is_hazard(&self, index: usize) -> bool {
        self.count[index] > 0
    }

    /// Returns the grid's window within reach.
    pub(crate) fn follow(&mut self, geometry: &Geometry, flip: Flip) -> Window {
        let Geometry { lattice, grid, reach } = *geometry;
        let centre = lattice.centre_of(flip.cell);
        let last = DVec2::splat(f64::from(grid.cells) - 1.0);
        let from = grid.to_cells(centre - reach).ceil().max(DVec2::ZERO);
        let to = grid.to_cells(centre + reach).floor().min(last);
        let mut window = Window::default();
        if from.cmpgt(to).any() {
            return window;
        }
        for row in from.y as u32..=to.y as u32 {
            for col in from.x as u32..=to.x as u32 {
                let cell = Cell { col, row };
                if grid.centre_of(cell).distance(centre) > reach {
                    continue;
                }
                let count = &mut self.count[grid.index(cell)];
                *count =
                    if flip.occupied { count.saturating_add(1) } else { count.saturating_sub(1) };
                window = window.including(cell);
            }
        }
        window
    }
}
