//! A rectangle of cells whose u a local update replaced, with u before it.

use crate::cell::Cell;
use crate::scaled::Scaled;
use crate::store::Store;

/// A rectangle of cells, inside the map.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) struct Rect {
    /// First column.
    pub col: usize,
    /// First row.
    pub row: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl Rect {
    pub(crate) fn contains(&self, (col, row): (i64, i64)) -> bool {
        let inside =
            |at: i64, start: usize, len: usize| (start as i64..(start + len) as i64).contains(&at);
        inside(col, self.col, self.width) && inside(row, self.row, self.height)
    }

    /// Whether the two overlap or touch, sides or corners.
    pub(crate) fn touches(&self, other: &Self) -> bool {
        let touch =
            |a: usize, a_len: usize, b: usize, b_len: usize| a <= b + b_len && b <= a + a_len;
        touch(self.col, self.width, other.col, other.width)
            && touch(self.row, self.height, other.row, other.height)
    }

    /// The smallest rectangle that holds both.
    pub(crate) fn union(&self, other: &Self) -> Self {
        let join = |a: usize, a_len: usize, b: usize, b_len: usize| {
            let start = a.min(b);
            (start, (a + a_len).max(b + b_len) - start)
        };
        let (col, width) = join(self.col, self.width, other.col, other.width);
        let (row, height) = join(self.row, self.height, other.row, other.height);
        Self {
            col,
            row,
            width,
            height,
        }
    }
}

/// What the solution of a window tells at its rim.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rim {
    /// Cells outside from which steepest ascent enters the window at a cell whose u is now lower than theirs.
    pub entries: Vec<Cell>,
    /// Largest |u after / u before - 1| on the outflow rim.
    pub deviation: f64,
    /// Largest u before on the outflow rim; zero if nothing flows out.
    pub largest: Scaled,
    /// Estimated error of directions at the inflow rim, radians.
    pub upstream: f64,
}

/// A local update: where, and u there before it.
#[derive(Clone, Debug)]
pub(crate) struct Patch {
    rect: Rect,
    /// Around the cells that changed.
    changed: Rect,
    /// Row-major over `rect`: the cells of it that were solved for.
    unknowns: Vec<bool>,
    /// Row-major over `rect`, as stored.
    before: Vec<(f64, i32)>,
    rim: Rim,
}

impl Patch {
    /// Keeps u of the cells of `rect` in a map of `map_width` columns.
    pub(crate) fn of(
        rect: Rect,
        changed: Rect,
        unknowns: Vec<bool>,
        rim: Rim,
        (store, map_width): (&Store, usize),
    ) -> Self {
        let mut before = Vec::with_capacity(rect.width * rect.height);
        for row in rect.row..rect.row + rect.height {
            let start = row * map_width + rect.col;
            store.read_raw(start..start + rect.width, &mut before);
        }
        Self {
            rect,
            changed,
            unknowns,
            before,
            rim,
        }
    }

    pub(crate) fn rim(&self) -> &Rim {
        &self.rim
    }

    pub(crate) fn rect(&self) -> &Rect {
        &self.rect
    }

    pub(crate) fn changed(&self) -> &Rect {
        &self.changed
    }

    /// Undoes the update.
    pub(crate) fn restore(&self, store: &mut Store, map_width: usize) {
        for (row, cells) in self.before.chunks_exact(self.rect.width).enumerate() {
            let start = (self.rect.row + row) * map_width + self.rect.col;
            store.write_raw(start, cells);
        }
    }

    pub(crate) fn contains(&self, cell: (i64, i64)) -> bool {
        self.rect.contains(cell) && self.unknowns[self.index(cell)]
    }

    /// u before the update, of a cell of the patch.
    pub(crate) fn before(&self, cell: (i64, i64)) -> Scaled {
        let (value, exponent) = self.before[self.index(cell)];
        Scaled::new(value, exponent)
    }

    fn index(&self, (col, row): (i64, i64)) -> usize {
        (row as usize - self.rect.row) * self.rect.width + col as usize - self.rect.col
    }
}
