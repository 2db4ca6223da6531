//! The live field, and cells of the grid as the field library names them.

use std::sync::Arc;

use common::grid::{self, CellState, GridFrame, Window};
use glam::DVec2;
use harmonic::{Cell, Change, Domain, Field, Guidance};

/// The live field and the domain it is of.
#[derive(Debug)]
pub(super) struct Live {
    pub(super) frame: GridFrame,
    pub(super) domain: Domain,
    /// Shared with the snapshots of it.
    pub(super) field: Arc<Field>,
}

/// As near as this to the middle of the cell that is aimed at beside the target, the robot has arrived, metres.
const BESIDE_M: f64 = 0.12;

impl Live {
    /// Whether the field's direction for a robot at `position` is one to follow; where it gives none, there is nothing to
    /// trust.
    pub(super) fn is_trusted(&self, position: DVec2) -> bool {
        let at = self.frame.to_cells(position);
        let cell = self.frame.cell_at(position).map(field_cell);
        !matches!(self.field.guidance(at.x, at.y), Guidance::Along(_))
            || cell.is_some_and(|cell| self.field.is_trusted(cell))
    }

    /// Whether the field leads to a cell beside `target`, and the robot has come there.
    pub(super) fn is_beside_the_target(&self, target: DVec2, robot: DVec2) -> bool {
        let aim = grid_cell(self.domain.target());
        let own = self.frame.cell_at(target) == Some(aim);
        !own && self.frame.centre_of(aim).distance(robot) <= BESIDE_M
    }
}

/// Cells of `window` that are hazard now and were not when `domain` was solved, and the other way round.
pub(super) fn changes_in(
    domain: &Domain,
    frame: &GridFrame,
    window: Window,
    cells: &[u8],
) -> Vec<Change> {
    let mut changes = Vec::new();
    for row in window.row..window.row + window.height {
        for col in window.col..window.col + window.width {
            let cell = grid::Cell { col, row };
            let blocked = is_hazard(cells[frame.index(cell)]);
            let cell = field_cell(cell);
            if blocked != domain.is_blocked(cell) {
                changes.push(Change { cell, blocked });
            }
        }
    }
    changes
}

/// A cell of the grid as the field library names it: the one place where one becomes the other.
pub(super) const fn field_cell(cell: grid::Cell) -> Cell {
    Cell::new(cell.col as usize, cell.row as usize)
}

/// The reverse of [`field_cell`].
const fn grid_cell(cell: Cell) -> grid::Cell {
    grid::Cell {
        col: cell.col as u32,
        row: cell.row as u32,
    }
}

pub(super) const fn is_hazard(cell: u8) -> bool {
    CellState::from_byte(cell).is_hazard()
}
