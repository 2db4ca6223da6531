//! A rectangle of cells and its place on a sheet, on which the layers of a field are drawn.

use common::grid::GridFrame;
use glam::DVec2;

use super::page::{PLOT_SIDE, View, metres};

/// A rectangle of cells, row-major, on a sheet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lattice {
    /// Columns.
    pub(super) cols: usize,
    pub(super) rows: usize,
    /// Width of all columns on the sheet.
    pub(super) width: f64,
    /// Height of all rows on the sheet.
    pub(super) height: f64,
    placing: Placing,
}

/// The position of a lattice.
#[derive(Clone, Copy, Debug)]
enum Placing {
    /// The lattice lies in the mission frame, metres, y up.
    Mission { frame: GridFrame, view: View },
    /// The lattice lies like an image from a corner of the sheet, with the first row at the top and `cell` units a cell.
    Image { corner: DVec2, cell: f64 },
}

impl Lattice {
    /// The cells of a mission's grid.
    pub(super) fn of_mission(frame: &GridFrame, view: &View) -> Self {
        Self {
            cols: frame.cells as usize,
            rows: frame.cells as usize,
            width: PLOT_SIDE,
            height: PLOT_SIDE,
            placing: Placing::Mission { frame: *frame, view: *view },
        }
    }

    /// The pixels of an image of `cols` x `rows`, each `cell` units wide, from `corner` on.
    pub(super) fn of_image((cols, rows): (usize, usize), corner: DVec2, cell: f64) -> Self {
        Self {
            cols,
            rows,
            width: cols as f64 * cell,
            height: rows as f64 * cell,
            placing: Placing::Image { corner, cell },
        }
    }

    /// The longer side, in cells.
    pub(super) fn longest(&self) -> usize {
        self.cols.max(self.rows)
    }

    /// The point on the sheet of a place in cells (cell centres at whole numbers).
    pub(super) fn place(&self, cells: DVec2) -> DVec2 {
        match &self.placing {
            Placing::Mission { frame, view } => view.place(metres(frame, cells)),
            Placing::Image { corner, cell } => *corner + (cells + 0.5) * *cell,
        }
    }
}
