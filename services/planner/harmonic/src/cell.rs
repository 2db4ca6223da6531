//! A cell of a map, and a change to one.

/// Longest side of a map, in cells.
pub const MAX_SIDE: usize = 16_384;

/// A cell of the map, by column and row from 0.
#[derive(Clone, Copy, Debug, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub struct Cell {
    /// Cells left of it.
    pub col: usize,
    /// Rows before its own.
    pub row: usize,
}

impl Cell {
    /// The cell at column `col` of row `row`.
    pub const fn new(col: usize, row: usize) -> Self {
        Self { col, row }
    }
}

/// A cell that became blocked or free since the field was solved.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct Change {
    /// The cell that changed.
    pub cell: Cell,
    /// Whether the cell is blocked from now on.
    pub blocked: bool,
}
