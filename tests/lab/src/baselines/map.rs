use common::grid::{Cell, CellState, GridFrame, Replica};
use glam::DVec2;

/// Step along a line of sight, in cells.
const SIGHT_STEP: f64 = 0.1;

/// Complete map whose hazard cells include the body's margin.
pub struct Map<'a> {
    pub frame: GridFrame,
    cells: &'a [u8],
}

impl<'a> Map<'a> {
    pub fn of(grid: &'a Replica<u8>) -> Option<Self> {
        Some(Self { frame: grid.frame()?, cells: grid.cells() })
    }

    pub fn is_free(&self, cell: Cell) -> bool {
        let inside = cell.col < self.frame.cells && cell.row < self.frame.cells;
        let byte = self.cells.get(self.frame.index(cell)).filter(|_| inside);
        byte.is_some_and(|&byte| !CellState::from_byte(byte).is_hazard())
    }

    pub fn free_cell_at(&self, point: DVec2) -> Option<Cell> {
        self.frame.cell_at(point).filter(|&cell| self.is_free(cell))
    }

    pub fn free_neighbour(&self, cell: Cell, [cols, rows]: [i32; 2]) -> Option<Cell> {
        let col = cell.col.checked_add_signed(cols)?;
        let row = cell.row.checked_add_signed(rows)?;
        Some(Cell { col, row }).filter(|&next| self.is_free(next))
    }

    /// Returns whether the line between two points, metres, is free.
    pub fn sees(&self, from: DVec2, to: DVec2) -> bool {
        let steps = (from.distance(to) / (SIGHT_STEP * self.frame.resolution_m)).ceil();
        let steps = steps.clamp(1.0, f64::from(u32::MAX)) as u32;
        let at = |step: u32| from.lerp(to, f64::from(step) / f64::from(steps));
        (0..=steps).all(|step| self.free_cell_at(at(step)).is_some())
    }

    pub fn nearest_free(&self, point: DVec2) -> Option<DVec2> {
        let free = self.frame.whole().cells().filter(|&cell| self.is_free(cell));
        let centres = free.map(|cell| self.frame.centre_of(cell));
        centres.min_by(|a, b| a.distance(point).total_cmp(&b.distance(point)))
    }
}
