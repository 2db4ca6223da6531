use common::grid::GridFrame;
use glam::DVec2;

use super::page::{PLOT_SIDE, View, metres};

/// Returns the indices of a place on a row-major grid and of its neighbours.
pub(super) fn around(
    [cols, rows]: [usize; 2],
    (col, row): (usize, usize),
) -> impl Iterator<Item = usize> {
    let columns = col.saturating_sub(1)..(col + 2).min(cols);
    (row.saturating_sub(1)..(row + 2).min(rows))
        .flat_map(move |row| columns.clone().map(move |col| row * cols + col))
}

#[derive(Clone, Copy)]
pub(super) struct Lattice {
    pub cols: usize,
    pub rows: usize,
    pub width: f64,
    pub height: f64,
    /// Outer corner of the first cell, and the cell steps in both directions.
    corner: DVec2,
    step: DVec2,
}

impl Lattice {
    pub(super) fn of_mission(frame: &GridFrame, view: &View) -> Self {
        let side = frame.cells as usize;
        let step = view.px(frame.resolution_m);
        Self {
            cols: side,
            rows: side,
            width: PLOT_SIDE,
            height: PLOT_SIDE,
            corner: view.place(metres(frame, DVec2::splat(-0.5))),
            step: DVec2::new(step, -step),
        }
    }

    /// Creates an image lattice from `corner`, first row at the top, cells `cell` units wide.
    pub(super) fn of_image((cols, rows): (usize, usize), corner: DVec2, cell: f64) -> Self {
        Self {
            cols,
            rows,
            width: cols as f64 * cell,
            height: rows as f64 * cell,
            corner,
            step: DVec2::splat(cell),
        }
    }

    pub(super) fn longest(&self) -> usize {
        self.cols.max(self.rows)
    }

    pub(super) fn place(&self, cells: DVec2) -> DVec2 {
        self.corner + (cells + 0.5) * self.step
    }
}
