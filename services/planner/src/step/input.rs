//! Inputs and outputs of the planner's step, and the field at one moment, from which the policy of every cell is computed while the
//! planner goes on.

use std::sync::Arc;

use common::{
    grid::GridFrame,
    samples::{
        FaultKind, FieldCell, FieldHeader, GridHeader, GuidanceSample, PoseSample, TargetSample,
    },
};
use glam::DVec2;
use harmonic::{Domain, Field, SolveError};

/// An input of the planner.
#[derive(Debug)]
pub enum Input<'a> {
    /// A sample of `grid`.
    Grid {
        header: &'a GridHeader,
        /// The cells of its window.
        cells: &'a [u8],
    },
    /// The target to which the robot is sent from now on.
    Target(&'a TargetSample),
    /// The pose of the tick, which is answered with guidance.
    Pose(&'a PoseSample),
    /// The guidance of the tick was given: the newest map may be solved, or a background solve begin.
    Idle,
    /// The result of a job.
    Solved(Solved),
    /// A fault is injected.
    Fault {
        fault: FaultKind,
        /// Where the robot is, metres.
        robot: DVec2,
    },
}

/// The consequences of an input.
#[derive(Debug, Default)]
pub struct Outcome {
    /// The effect of the input on the field.
    pub work: Work,
    /// The answer to a pose.
    pub guidance: Option<GuidanceSample>,
    /// The job that the background solver has to begin.
    pub job: Option<Job>,
}

impl From<Work> for Outcome {
    fn from(work: Work) -> Self {
        Self { work, ..Self::default() }
    }
}

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
        let mut cells = Vec::with_capacity(self.frame.area());
        for row in 0..self.frame.cells as usize {
            self.append_row(row, &mut cells);
        }
        cells
    }

    pub fn append_row(&self, row: usize, cells: &mut Vec<FieldCell>) {
        self.field.policy_of_row(row, |policy| {
            let [ex, ey] = policy.direction.map(|component| component as f32);
            let log2_u = policy.log2_u as f32;
            cells.push(FieldCell { ex, ey, log2_u });
        });
    }
}
