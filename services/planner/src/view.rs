//! Belief and a field over it.

use common::grid::{Cell, CellState, GridFrame};
use glam::DVec2;
use harmonic::{Field, Guidance};

/// Distance between points of a way, metres.
pub(crate) const STEP_M: f64 = 0.05;
/// Step of the search for unscanned cells on a fine grid, metres.
const GRAIN_M: f64 = 0.025;

#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    pub frame: GridFrame,
    /// [`CellState`] byte per cell, row-major.
    pub cells: &'a [u8],
    pub field: &'a Field,
    /// Cells that the field avoids because the body cannot pass, row-major; empty if there are
    /// none.
    pub refused: &'a [bool],
}

impl View<'_> {
    pub(crate) fn guidance(&self, at: DVec2) -> Guidance {
        let cells = self.frame.to_cells(at);
        debug_assert_eq!(self.field.width(), self.frame.cells as usize);
        self.field.guidance(cells.x, cells.y)
    }

    /// Returns points of the field's way for `length_m` metres from `from`, first along
    /// `direction`.
    pub(crate) fn way(&self, from: DVec2, direction: DVec2, length_m: f64) -> Vec<DVec2> {
        let steps = (length_m / STEP_M) as usize;
        let mut way = Vec::with_capacity(steps);
        let (mut at, mut direction) = (from, direction);
        while way.len() < steps {
            at += direction * STEP_M;
            way.push(at);
            match self.guidance(at) {
                Guidance::Along(next) => direction = next.into(),
                _ => break,
            }
        }
        way
    }

    pub(crate) fn is_hazard(&self, at: DVec2) -> bool {
        self.frame.cell_at(at).is_none_or(|cell| self.state(cell).is_hazard())
    }

    pub(crate) fn has_hazard(&self, at: DVec2, radius: f64) -> bool {
        self.cells_within(at, radius, 1).any(|cell| self.state(cell).is_hazard())
    }

    /// Returns whether all cells within `depth_m` are hazard.
    ///
    /// An inflated obstacle is then nearer than the inflation minus `depth_m`.
    pub(crate) fn is_deep(&self, at: DVec2, depth_m: f64) -> bool {
        let is_hazard = |cell| self.state(cell).is_hazard();
        self.frame.cell_at(at).is_some_and(is_hazard)
            && self.cells_within(at, depth_m, 1).all(is_hazard)
    }

    /// Compares the cells within `radius` with the map of the field.
    pub(crate) fn has_changed(&self, at: DVec2, radius: f64) -> bool {
        self.cells_within(at, radius, 1).any(|cell| {
            let blocked = self.is_refused(cell) || self.state(cell).is_hazard();
            blocked != self.field.is_blocked(field_cell(cell))
        })
    }

    pub(crate) fn is_refused(&self, cell: Cell) -> bool {
        debug_assert!(self.refused.is_empty() || self.refused.len() == self.frame.area());
        self.refused.get(self.frame.index(cell)) == Some(&true)
    }

    /// Free and sensed cells within `radius`.
    pub(crate) fn unscanned(&self, at: DVec2, radius: f64) -> impl Iterator<Item = DVec2> {
        let step = (GRAIN_M / self.frame.resolution_m).max(1.0) as usize;
        self.cells_within(at, radius, step)
            .filter(|&cell| matches!(self.state(cell), CellState::Free | CellState::Sensed))
            .map(|cell| self.frame.centre_of(cell))
    }

    pub(crate) fn cells_within(
        &self,
        at: DVec2,
        radius: f64,
        step: usize,
    ) -> impl Iterator<Item = Cell> {
        assert!(step > 0);
        let frame = self.frame;
        let last = f64::from(frame.cells) - 1.0;
        let inside = |corner: DVec2| corner.clamp(DVec2::ZERO, DVec2::splat(last));
        let from = inside(frame.to_cells(at - radius).ceil());
        let to = inside(frame.to_cells(at + radius).floor());
        (from.y as u32..=to.y as u32)
            .step_by(step)
            .flat_map(move |row| {
                let columns = (from.x as u32..=to.x as u32).step_by(step);
                columns.map(move |col| Cell { col, row })
            })
            .filter(move |&cell| frame.centre_of(cell).distance(at) <= radius)
    }

    fn state(&self, cell: Cell) -> CellState {
        let byte = self.cells.get(self.frame.index(cell)).copied();
        byte.map_or(CellState::Perimeter, CellState::from_byte)
    }
}

pub(crate) const fn field_cell(cell: Cell) -> harmonic::Cell {
    harmonic::Cell::new(cell.col as usize, cell.row as usize)
}
