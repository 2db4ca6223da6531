/// Longest side of a map, in cells.
pub const MAX_SIDE: usize = 16_384;

/// Cell of a map.
#[derive(Clone, Copy, Debug, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub struct Cell {
    /// Column, from 0.
    pub col: usize,
    /// Row, from 0.
    pub row: usize,
}

impl Cell {
    /// Creates a cell.
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
