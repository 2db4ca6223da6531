//! Grid cells, their states and windows, and their position in the mission frame.

use std::borrow::Cow;

use glam::DVec2;
use serde::{Deserialize, Serialize};

wire_enum! {
    /// Cell state by (18), (19) and the a-priori map, a byte of the `grid` topic. An unknown byte
    /// counts as a hazard.
    #[derive(Serialize, Deserialize)]
    CellState, unknown = Perimeter {
        /// Possibly safe: 0 in the paper's DSE.
        Free = 0,
        /// Safety event or its margin.
        Sensed = 1,
        Known = 2,
        /// Perimeter of operation; never cleared.
        Perimeter = 3,
        /// Possibly safe and scanned by the sonar; only the evidential method distinguishes it from
        /// [`Free`](Self::Free).
        Scanned = 4,
        /// Scanned and empty, but the body would touch something nearby: a hazard.
        Margin = 5,
    }
}

impl CellState {
    /// Returns whether the harmonic field is 0 here.
    pub const fn is_hazard(self) -> bool {
        !matches!(self, Self::Free | Self::Scanned)
    }

    pub const fn is_scanned(self) -> bool {
        matches!(self, Self::Scanned | Self::Margin)
    }
}

/// Fewest cells per side that leave space within the perimeter.
pub const MIN_CELLS: u32 = 10;
/// Most cells per side that the solver accepts.
pub const MAX_CELLS: u32 = 4096;

/// Grid cell: `col` grows with x, `row` with y.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Cell {
    pub col: u32,
    pub row: u32,
}

/// Rectangle of cells; empty if either extent is 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Window {
    pub col: u32,
    pub row: u32,
    pub width: u32,
    pub height: u32,
}

impl Window {
    pub const fn area(&self) -> usize {
        self.width as usize * self.height as usize
    }

    pub fn including(self, cell: Cell) -> Self {
        if self.area() == 0 {
            return Self { col: cell.col, row: cell.row, width: 1, height: 1 };
        }
        let col = self.col.min(cell.col);
        let row = self.row.min(cell.row);
        Self {
            col,
            row,
            width: (self.col + self.width).max(cell.col + 1) - col,
            height: (self.row + self.height).max(cell.row + 1) - row,
        }
    }

    /// Returns the cells row by row.
    pub fn cells(self) -> impl Iterator<Item = Cell> {
        let columns = self.col..self.col + self.width;
        (self.row..self.row + self.height)
            .flat_map(move |row| columns.clone().map(move |col| Cell { col, row }))
    }

    pub fn union(self, other: Self) -> Self {
        if other.area() == 0 {
            return self;
        }
        let Self { col, row, width, height } = other;
        let last = Cell { col: col + width - 1, row: row + height - 1 };
        self.including(Cell { col, row }).including(last)
    }
}

/// Frame of the N x N cells in the mission frame: (19) with the origin at the centre.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GridFrame {
    /// N, along each side.
    pub cells: u32,
    /// Delta.
    pub resolution_m: f64,
    /// Centre cell, metres.
    pub centre: DVec2,
}

impl GridFrame {
    pub const fn centre_index(&self) -> u32 {
        self.cells / 2
    }

    pub const fn area(&self) -> usize {
        self.cells as usize * self.cells as usize
    }

    /// Converts metres to cell units, in which cell centres are integers.
    pub fn to_cells(&self, point: DVec2) -> DVec2 {
        (point - self.centre) / self.resolution_m + f64::from(self.centre_index())
    }

    /// Returns [x / Delta] of (19).
    pub fn cell_at(&self, point: DVec2) -> Option<Cell> {
        let index = self.to_cells(point).round();
        let last = f64::from(self.cells) - 1.0;
        // This form also rejects NaN.
        if !(index.cmpge(DVec2::ZERO).all() && index.cmple(DVec2::splat(last)).all()) {
            return None;
        }
        Some(Cell { col: index.x as u32, row: index.y as u32 })
    }

    pub fn centre_of(&self, cell: Cell) -> DVec2 {
        let centre = f64::from(self.centre_index());
        let offset = DVec2::new(cell.col.into(), cell.row.into()) - centre;
        self.centre + offset * self.resolution_m
    }

    /// Returns the lower left corner of the map.
    pub fn corner(&self) -> DVec2 {
        self.centre_of(Cell { col: 0, row: 0 }) - self.resolution_m / 2.0
    }

    /// Returns the index in a row-major slice of the whole map.
    pub const fn index(&self, cell: Cell) -> usize {
        cell.row as usize * self.cells as usize + cell.col as usize
    }

    pub const fn is_rim(&self, cell: Cell) -> bool {
        let last = self.cells - 1;
        cell.col == 0 || cell.row == 0 || cell.col >= last || cell.row >= last
    }

    pub const fn whole(&self) -> Window {
        Window { col: 0, row: 0, width: self.cells, height: self.cells }
    }

    /// Returns the window of an axis-aligned rectangle, metres, clamped to the map.
    pub fn between(&self, least: DVec2, greatest: DVec2) -> Window {
        let last = DVec2::splat(f64::from(self.cells) - 1.0);
        let cell = |at: DVec2| {
            let at = at.clamp(DVec2::ZERO, last);
            Cell { col: at.x as u32, row: at.y as u32 }
        };
        Window::default()
            .including(cell(self.to_cells(least).floor()))
            .including(cell(self.to_cells(greatest).ceil()))
    }

    /// Returns the window of a square around `centre`, metres, clamped to the map.
    pub fn around(&self, centre: DVec2, reach_m: f64) -> Window {
        self.between(centre - reach_m, centre + reach_m)
    }

    pub fn cells_of<'map, T: Copy>(&self, window: Window, map: &'map [T]) -> Cow<'map, [T]> {
        assert!(self.contains(window));
        assert_eq!(map.len(), self.area());
        if window == self.whole() {
            return Cow::Borrowed(map);
        }
        let mut cells = Vec::with_capacity(window.area());
        for row in window.row..window.row + window.height {
            let start = self.index(Cell { col: window.col, row });
            cells.extend_from_slice(&map[start..start + window.width as usize]);
        }
        Cow::Owned(cells)
    }

    pub fn changed_window<T: PartialEq>(&self, old: &[T], new: &[T]) -> Window {
        assert_eq!(old.len(), new.len());
        assert_eq!(old.len(), self.area());
        let side = self.cells as usize;
        let mut window = Window::default();
        let rows = old.chunks_exact(side).zip(new.chunks_exact(side));
        for (row, (old, new)) in rows.enumerate() {
            // Comparing whole rows first is several times as fast: most are equal.
            if old == new {
                continue;
            }
            let differs = |(old, new): (&T, &T)| old != new;
            let first = old.iter().zip(new).position(differs);
            let last = old.iter().zip(new).rposition(differs);
            for col in [first, last].into_iter().flatten() {
                window = window.including(Cell { col: col as u32, row: row as u32 });
            }
        }
        window
    }

    pub fn contains(&self, window: Window) -> bool {
        let fits =
            |from: u32, extent: u32| from.checked_add(extent).is_some_and(|end| end <= self.cells);
        fits(window.col, window.width) && fits(window.row, window.height)
    }
}
