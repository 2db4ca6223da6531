//! Factors and working memory of a factorisation.

use crate::Scaled;

/// Memory reused between solves: fresh pages from the system cost as much as filling them.
#[derive(Debug, Default)]
pub(crate) struct Workspace {
    pub(super) factors: Factors,
    /// Position in the current front of each place; all `NOWHERE` between fronts.
    pub(super) slot: Vec<u32>,
    pub(super) u: Vec<Scaled>,
}

/// Limit of bytes held between solves: a maze of half a million cells. For larger maps, fresh pages
/// cost little in comparison.
const MOST_HELD_BYTES: usize = 64 << 20;

impl Workspace {
    pub(super) fn trim(&mut self) {
        let bytes = size_of::<f64>() * self.factors.rows.capacity()
            + size_of::<u32>() * (self.factors.lengths.capacity() + self.slot.capacity())
            + size_of::<Scaled>() * self.u.capacity();
        if bytes > MOST_HELD_BYTES {
            *self = Self::default();
        }
    }
}

#[derive(Debug, Default)]
pub(super) struct Factors {
    pub(super) rows: Vec<f64>,
    pub(super) lengths: Vec<u32>,
}
