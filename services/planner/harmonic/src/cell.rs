//! Cells of a map, and changes to them.

/// Longest side of a map, in cells.
pub const MAX_SIDE: usize = 16_384;

/// Cell of a map.
///
/// Column and row count from 0.
#[derive(Clone, Copy, Debug, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub struct Cell {
    /// Column index.
    pub col: usize,
    /// Row index.
    pub row: usize,
}

impl Cell {
    /// Creates the cell at column `col` of row `row`.
    pub const fn new(col: usize, row: usize) -> Self {
        Self { col, row }
    }
}

/// Cell that became blocked or free since the last solve.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct Change {
    /// Changed cell.
    pub cell: Cell,
    /// New state: true for blocked.
    pub blocked: bool,
}
