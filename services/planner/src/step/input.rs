//! What goes into the planner's step and what comes out.

use common::samples::{FaultKind, GridHeader, GuidanceSample, PoseSample};
use glam::DVec2;

use harmonic::{Domain, Field, SolveError};

/// in lockstep the result of a background solve is an input so many ticks after it began, no sooner and no
/// later, so that a run can be repeated. At 7 Hz the largest map is solved by then on a wall clock, too.
const SWAP_AFTER_TICKS: u64 = 2;

/// What the planner takes.
#[derive(Debug)]
pub enum Input<'a> {
    /// A sample of `grid`.
    Grid {
        /// Its header.
        header: &'a GridHeader,
        /// The cells of its window.
        cells: &'a [u8],
    },
    /// The pose of the tick: it is answered with guidance.
    Pose(&'a PoseSample),
    /// The tick has its guidance: a background solve may begin.
    Idle,
    /// What became of a job.
    Solved(Solved),
    /// Break like this, on purpose.
    Fault {
        /// How.
        fault: FaultKind,
        /// Where the robot is, metres.
        robot: DVec2,
    },
}

/// What follows from an input.
#[derive(Debug, Default)]
pub struct Outcome {
    /// What became of the field.
    pub work: Work,
    /// The answer to a pose.
    pub guidance: Option<GuidanceSample>,
    /// What the background solver has to begin.
    pub job: Option<Job>,
}

impl From<Work> for Outcome {
    fn from(work: Work) -> Self {
        Self {
            work,
            ..Self::default()
        }
    }
}

/// What an input did to the field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Work {
    /// Nothing.
    #[default]
    None,
    /// It was computed anew.
    FullSolve,
    /// It was brought up to date around what changed.
    LocalUpdate,
    /// The result of a background solve took its place.
    SwappedIn,
    /// It was broken on purpose.
    Broken,
    /// Nothing, for a version of the grid is missing: the field is as it was until a keyframe comes.
    Missed,
}

impl Work {
    /// Whether the field is another now.
    #[must_use]
    pub const fn changed(self) -> bool {
        !matches!(self, Self::None | Self::Missed)
    }
}

/// A full solve for the background solver.
#[derive(Debug)]
pub struct Job {
    /// Names it.
    pub number: u64,
    /// Whether the live field waits for it.
    pub urgent: bool,
    /// The map to solve.
    pub domain: Domain,
}

impl Job {
    /// in lockstep, how many ticks after it began its result is an input.
    #[must_use]
    pub const fn swap_after_ticks(&self) -> u64 {
        // A robot that waits for it waits no longer than it must.
        if self.urgent { 1 } else { SWAP_AFTER_TICKS }
    }
}

/// What became of a job.
#[derive(Debug)]
pub struct Solved {
    /// The job's number.
    pub number: u64,
    /// Its map, and the field of it.
    pub result: Result<Box<(Domain, Field)>, SolveError>,
    /// How long it took, nanoseconds of wall-clock; nothing is decided by it.
    pub took_ns: u64,
}
