//! A rectangle of cells whose u was computed anew, with what it was before.

use std::ops::Range;

use crate::field::Store;
use crate::scaled::{Scaled, pow2};

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
    pub(super) fn contains(&self, (col, row): (i64, i64)) -> bool {
        let inside =
            |at: i64, start: usize, len: usize| (start as i64..(start + len) as i64).contains(&at);
        inside(col, self.col, self.width) && inside(row, self.row, self.height)
    }

    /// Whether the two overlap or touch, sides or corners.
    pub(super) fn touches(&self, other: &Self) -> bool {
        let touch =
            |a: usize, a_len: usize, b: usize, b_len: usize| a <= b + b_len && b <= a + a_len;
        touch(self.col, self.width, other.col, other.width)
            && touch(self.row, self.height, other.row, other.height)
    }

    /// The smallest rectangle that holds both.
    pub(super) fn union(&self, other: &Self) -> Self {
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

/// A local update: where, and u there before it.
#[derive(Clone, Debug)]
pub(crate) struct Patch {
    rect: Rect,
    /// Around the cells that changed.
    changed: Rect,
    /// Row-major over `rect`: the cells of it that were solved for.
    taken: Vec<bool>,
    /// Row-major over `rect`, as stored.
    before: Vec<(f64, i32)>,
}

impl Patch {
    /// Remembers u of the cells of `rect` in a map of `map_width` columns.
    pub(super) fn of(
        rect: Rect,
        changed: Rect,
        taken: Vec<bool>,
        store: &Store,
        map_width: usize,
    ) -> Self {
        let mut before = Vec::with_capacity(rect.width * rect.height);
        for row in rect.row..rect.row + rect.height {
            let start = row * map_width + rect.col;
            remember(store, start..start + rect.width, &mut before);
        }
        Self {
            rect,
            changed,
            taken,
            before,
        }
    }

    pub(super) fn rect(&self) -> &Rect {
        &self.rect
    }

    pub(super) fn changed(&self) -> &Rect {
        &self.changed
    }

    /// Undoes the update.
    pub(super) fn restore(&self, store: &mut Store, map_width: usize) {
        for (row, cells) in self.before.chunks_exact(self.rect.width).enumerate() {
            let start = (self.rect.row + row) * map_width + self.rect.col;
            bring_back(store, start, cells);
        }
    }

    pub(crate) fn contains(&self, cell: (i64, i64)) -> bool {
        self.rect.contains(cell) && self.taken[self.index(cell)]
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

// The store's own accessors ask for its kind at every cell; most stores are single, and a window has thousands.

/// Appends a run of cells, as stored.
fn remember(store: &Store, cells: Range<usize>, into: &mut Vec<(f64, i32)>) {
    match store {
        Store::Single { values, exponent } => {
            into.extend(values[cells].iter().map(|&u| (f64::from(u), *exponent)));
        }
        _ => into.extend(cells.map(|index| store.raw(index))),
    }
}

/// Writes a run of cells from `first` on, as they were remembered.
fn bring_back(store: &mut Store, first: usize, cells: &[(f64, i32)]) {
    if let Store::Single { values, exponent } = store
        && cells.iter().all(|cell| cell.1 == *exponent)
    {
        for (to, cell) in values[first..].iter_mut().zip(cells) {
            *to = cell.0 as f32;
        }
        return;
    }
    // The store may have been extended since.
    for (at, &(value, exponent)) in cells.iter().enumerate() {
        store.set(first + at, value, exponent);
    }
}

/// Sets the cells from `first` on for which `wanted` holds to u in units of 2^`reference`; negative is blocked.
pub(super) fn set_row(store: &mut Store, first: usize, u: &[f32], reference: i32, wanted: &[bool]) {
    if let Store::Single { values, exponent } = store {
        // Zero and what blocks stay what they are; a power of two rounds nothing while the numbers stay normal.
        let scale = pow2(reference.saturating_sub(*exponent));
        let scaled = |u: f32| {
            if u > 0.0 {
                f64::from(u) * scale
            } else {
                f64::from(u)
            }
        };
        let normal = f64::from(f32::MIN_POSITIVE)..=f64::from(f32::MAX);
        let fits = |u: f32| u <= 0.0 || normal.contains(&scaled(u));
        if u.iter().zip(wanted).all(|(&u, &wanted)| !wanted | fits(u)) {
            for ((to, &u), &wanted) in values[first..].iter_mut().zip(u).zip(wanted) {
                *to = if wanted { scaled(u) as f32 } else { *to };
            }
            return;
        }
    }
    store.set_row(first, u, reference, wanted);
}
