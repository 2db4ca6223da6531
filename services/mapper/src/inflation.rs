//! Cells within reach of an occupied cell, which are forbidden to the body's centre.

use common::grid::{GridFrame, Window};

use crate::evidence_grid::Flip;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Geometry {
    pub(crate) lattice: GridFrame,
    pub(crate) grid: GridFrame,
    /// Maximum centre distance that an occupied cell blocks, metres.
    pub(crate) reach: f64,
}

/// Number of occupied lattice cells within reach of each grid cell, row-major.
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

    /// Applies a flip.
    pub(crate) fn follow(&mut self, geometry: &Geometry, flip: Flip) -> Window {
        let Geometry { lattice, grid, reach } = *geometry;
        let centre = lattice.centre_of(flip.cell);
        let mut window = Window::default();
        for cell in grid.between(centre - reach, centre + reach).cells() {
            if grid.centre_of(cell).distance(centre) <= reach {
                let count = &mut self.count[grid.index(cell)];
                let change = if flip.occupied { 1 } else { -1 };
                *count = count.saturating_add_signed(change);
                window = window.including(cell);
            }
        }
        window
    }
}
