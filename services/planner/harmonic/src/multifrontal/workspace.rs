//! Factors and working memory of a factorisation.

use crate::Scaled;

/// Memory reused between solves: fresh pages from the system cost as much as filling them.
#[derive(Debug, Default)]
pub(crate) struct Workspace {
    /// Rows of factors, one after another, and their lengths.
    pub rows: Vec<f64>,
    pub lengths: Vec<u32>,
    /// Position in the current front of each place; all `NOWHERE` between fronts.
    pub slot: Vec<u32>,
    pub u: Vec<Scaled>,
}

/// Limit of bytes held between solves: a maze of half a million cells. For larger maps, fresh pages
/// cost little in comparison.
const MOST_HELD_BYTES: usize = 64 << 20;

impl Workspace {
    pub(super) fn trim(&mut self) {
        let bytes = size_of::<f64>() * self.rows.capacity()
            + size_of::<u32>() * (self.lengths.capacity() + self.slot.capacity())
            + size_of::<Scaled>() * self.u.capacity();
        if bytes > MOST_HELD_BYTES {
            *self = Self::default();
        }
    }
}
