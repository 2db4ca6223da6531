//! Where the body's centre must not be: everything within a reach of what is occupied.

use common::grid::{Cell, GridFrame, Window};

use crate::evidence::Flip;

/// How many occupied cells of the lattice each cell of the grid is in reach of.
#[derive(Clone, Debug)]
pub(crate) struct Dilation {
    lattice: GridFrame,
    grid: GridFrame,
    reach: f64,
    count: Vec<u16>,
}

impl Dilation {
    /// Of nothing: cells of `lattice` will reach `reach` metres over cells of `grid`.
    pub(crate) fn new(lattice: GridFrame, grid: GridFrame, reach: f64) -> Self {
        Self {
            lattice,
            grid,
            reach,
            count: vec![0; grid.area()],
        }
    }

    /// Whether an occupied cell is in reach.
    pub(crate) fn is_hazard(&self, index: usize) -> bool {
        self.count[index] > 0
    }

    /// Follow one flip; the window of the grid it reaches.
    pub(crate) fn follow(&mut self, flip: Flip) -> Window {
        let centre = self.lattice.centre_of(flip.cell);
        let grid = self.grid;
        let last = f64::from(grid.cells) - 1.0;
        let from = grid
            .to_cells(centre - self.reach)
            .ceil()
            .max(glam::DVec2::ZERO);
        let to = grid
            .to_cells(centre + self.reach)
            .floor()
            .min(glam::DVec2::splat(last));
        let mut window = Window::default();
        if from.cmpgt(to).any() {
            return window;
        }
        for row in from.y as u32..=to.y as u32 {
            for col in from.x as u32..=to.x as u32 {
                let cell = Cell { col, row };
                if grid.centre_of(cell).distance(centre) > self.reach {
                    continue;
                }
                let count = &mut self.count[grid.index(cell)];
                *count = if flip.occupied {
                    count.saturating_add(1)
                } else {
                    count.saturating_sub(1)
                };
                window = window.including(cell);
            }
        }
        window
    }
}
