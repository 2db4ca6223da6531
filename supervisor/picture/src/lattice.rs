//! Cells and their place on a sheet.

use common::grid::GridFrame;
use glam::DVec2;

use super::page::{PLOT_SIDE, View, metres};

#[derive(Clone, Copy, Debug)]
pub(super) struct Lattice {
    pub(super) cols: usize,
    pub(super) rows: usize,
    pub(super) width: f64,
    pub(super) height: f64,
    placing: Placing,
}

#[derive(Clone, Copy, Debug)]
enum Placing {
    /// The mission frame, metres, y up.
    Mission { frame: GridFrame, view: View },
    /// Like an image, from a corner of the sheet, with the first row at the top and `cell` units a cell.
    Image { corner: DVec2, cell: f64 },
}

impl Lattice {
    pub(super) fn of_mission(frame: &GridFrame, view: &View) -> Self {
        Self {
            cols: frame.cells as usize,
            rows: frame.cells as usize,
            width: PLOT_SIDE,
            height: PLOT_SIDE,
            placing: Placing::Mission { frame: *frame, view: *view },
        }
    }

    /// Each pixel is `cell` units wide.
    pub(super) fn of_image((cols, rows): (usize, usize), corner: DVec2, cell: f64) -> Self {
        Self {
            cols,
            rows,
            width: cols as f64 * cell,
            height: rows as f64 * cell,
            placing: Placing::Image { corner, cell },
        }
    }

    pub(super) fn longest(&self) -> usize {
        self.cols.max(self.rows)
    }

    /// `cells` has cell centres at whole numbers.
    pub(super) fn place(&self, cells: DVec2) -> DVec2 {
        match &self.placing {
            Placing::Mission { frame, view } => view.place(metres(frame, cells)),
            Placing::Image { corner, cell } => *corner + (cells + 0.5) * *cell,
        }
    }
}
