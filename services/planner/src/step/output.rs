//! Results of the planner's step, and a snapshot of the field.
//!
//! The policy of every cell is computed from the snapshot while the planner continues.

use std::sync::Arc;

use common::{
    grid::GridFrame,
    samples::{FieldCell, FieldHeader},
};
use harmonic::{Domain, Field, SolveError};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Work {
    #[default]
    None,
    Solved,
    /// Field belongs to an older map now.
    Stale,
    SwappedIn,
    Broken,
    /// Grid version is missing; the field stays until a keyframe arrives.
    Missed,
}

impl Work {
    pub const fn changed(self) -> bool {
        matches!(self, Self::Solved | Self::SwappedIn | Self::Broken)
    }
}

#[derive(Debug)]
pub struct Job {
    pub number: u64,
    pub domain: Domain,
}

#[derive(Debug)]
pub struct Solved {
    pub number: u64,
    pub field: Result<Arc<Field>, SolveError>,
    /// Duration of the solve, ns; decisions ignore it.
    pub took_ns: u64,
}

#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Header without stamp and part.
    pub header: FieldHeader,
    pub frame: GridFrame,
    pub(super) field: Arc<Field>,
}

impl Snapshot {
    pub fn cells(&self) -> Vec<FieldCell> {
        self.cells_with(|_| ())
    }

    /// Returns the cells, row-major, and calls `after_row` after each row.
    pub(crate) fn cells_with(&self, after_row: impl Fn(usize)) -> Vec<FieldCell> {
        let mut cells = Vec::with_capacity(self.frame.area());
        for row in 0..self.frame.cells as usize {
            self.field.policy_of_row(row, |policy| {
                let [ex, ey] = policy.direction.map(|component| component as f32);
                cells.push(FieldCell { ex, ey, log2_u: policy.log2_u as f32 });
            });
            after_row(row);
        }
        cells
    }
}
