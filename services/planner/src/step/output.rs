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
    /// The field is as it was.
    #[default]
    None,
    /// The field was solved.
    Solved,
    /// The field is now of an older map.
    Stale,
    /// The result of a background solve replaced the field.
    SwappedIn,
    /// A fault was injected into the field.
    Broken,
    /// A version of the grid is missing: the field stays as it is until a keyframe comes.
    Missed,
}

impl Work {
    /// Whether the field was replaced or changed.
    pub const fn changed(self) -> bool {
        matches!(self, Self::Solved | Self::SwappedIn | Self::Broken)
    }
}

/// A solve for the background solver.
#[derive(Debug)]
pub struct Job {
    /// The number of the job, from 1.
    pub number: u64,
    /// The map to solve.
    pub domain: Domain,
}

/// The result of a job.
#[derive(Debug)]
pub struct Solved {
    pub number: u64,
    /// The field of the job's map.
    pub field: Result<Arc<Field>, SolveError>,
    /// Wall-clock time of the solve, nanoseconds; no decision depends on it.
    pub took_ns: u64,
}

/// The field at one moment.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// The header of a `field` sample; stamp and part are still to be set.
    pub header: FieldHeader,
    /// The frame of its cells.
    pub frame: GridFrame,
    pub(super) field: Arc<Field>,
}

impl Snapshot {
    /// The policy of every cell, row-major.
    pub fn cells(&self) -> Vec<FieldCell> {
        let mut cells = Vec::with_capacity(self.frame.area());
        for row in 0..self.frame.cells as usize {
            self.append_row(row, &mut cells);
        }
        cells
    }

    /// Append the policy of the cells of `row` to `cells`.
    pub fn append_row(&self, row: usize, cells: &mut Vec<FieldCell>) {
        self.field.policy_of_row(row, |policy| {
            let [ex, ey] = policy.direction.map(|component| component as f32);
            let log2_u = policy.log2_u as f32;
            cells.push(FieldCell { ex, ey, log2_u });
        });
    }
}
