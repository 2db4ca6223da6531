//! What the planner's step gives, and the field at one moment, from which the policy of every cell is computed while the
//! planner goes on.

use std::sync::Arc;

use common::{
    grid::GridFrame,
    samples::{FieldCell, FieldHeader},
};
use harmonic::{Domain, Field, SolveError};

/// The effect of an input on the field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Work {
    #[default]
    None,
    Solved,
    /// The field is now of an older map.
    Stale,
    /// The result of a background solve replaced the field.
    SwappedIn,
    Broken,
    /// A version of the grid is missing: the field stays as it is until a keyframe comes.
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
    /// No decision depends on it.
    pub took_ns: u64,
}

#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Without stamp and part.
    pub header: FieldHeader,
    pub frame: GridFrame,
    pub(super) field: Arc<Field>,
}

impl Snapshot {
    /// Row-major.
    pub fn cells(&self) -> Vec<FieldCell> {
        self.cells_with(|_| ())
    }

    /// Likewise; `after_row` is told each row.
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
