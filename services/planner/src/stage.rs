//! The planner as a stage: what it records and publishes.

use std::{borrow::Cow, collections::VecDeque, time::Instant};

use common::{
    grid::Part,
    inputs,
    mission::Mission,
    outputs::Outputs,
    samples::{FaultKind, FieldHeader, GridHeader, GuidanceSample, PoseSample, TargetSample},
    shell::{Context, Progress},
    stage::Stage,
    start::StageError,
    step::{ForeignState, Step as _},
    topics::{FIELD, GUIDANCE},
};
use glam::DVec2;
use harmonic::SolveError;
use serde::{Deserialize, Serialize};

use crate::{
    background_solver::Worker,
    field_publisher::Policy,
    step::{Input, Job, Planner, Snapshot, Solved, Work},
};

/// An action of the planner, and its tick.
#[derive(Debug, Serialize, Deserialize)]
pub struct Entry<'a> {
    #[serde(borrow)]
    pub(crate) taken: Taken<'a>,
    pub(crate) at: Progress,
}

/// An action of the planner.
#[derive(Debug, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "there is one at a time, on the stack")]
pub(crate) enum Taken<'a> {
    /// A sample of `grid`.
    Grid(#[serde(with = "inputs::slice")] (GridHeader, Cow<'a, [u8]>)),
    /// The pose of the tick; its guidance is published.
    Pose {
        #[serde(with = "inputs::sample")]
        pose: PoseSample,
        /// The last full solve's, added to the guidance.
        full_solve_ns: u64,
    },
    Idle,
    Solved(u64),
    /// The robot is here, metres.
    Fault(FaultKind, DVec2),
    /// This part of the newest policy is published.
    Field(#[serde(with = "inputs::sample")] Part),
    /// A policy of the field is due.
    Policy,
    Target(#[serde(with = "inputs::sample")] TargetSample),
}

/// The step, and the computations outside of it: threads take the jobs and give the results, or this thread does in a replay.
pub struct PlannerStage {
    pub(crate) planner: Planner,
    /// Not begun, oldest first.
    pub(crate) jobs: VecDeque<Job>,
    pub(crate) solved: Option<Solved>,
    /// A policy of this field is due.
    pub(crate) snapshot: Option<Snapshot>,
    pub(crate) policy: Option<Policy>,
    pub(crate) full_solve_ns: u64,
    worker: Worker,
}

impl Stage for PlannerStage {
    type Start = ();
    type Entry<'a> = Entry<'a>;
    /// The process ends after an error.
    type Outcome = Result<Work, SolveError>;

    fn new(mission: &Mission) -> Self {
        Self {
            planner: Planner::new(mission),
            jobs: VecDeque::new(),
            solved: None,
            snapshot: None,
            policy: None,
            full_solve_ns: 0,
            worker: Worker::default(),
        }
    }

    fn start(&self, _: &mut Context) -> Result<(), StageError> {
        Ok(())
    }

    fn begin(&mut self, (): ()) -> Result<(), ForeignState> {
        Ok(())
    }

    fn take(&mut self, entry: Entry<'_>, out: &mut Outputs) -> Result<Self::Outcome, StageError> {
        let Entry { taken, at } = entry;
        let began = Instant::now();
        let outcome = match taken {
            Taken::Grid((header, cells)) => {
                self.planner.step(Input::Grid { header: &header, cells: &cells }, at.time)
            }
            Taken::Pose { pose, full_solve_ns } => {
                out.at = at;
                let outcome = self.planner.step(Input::Pose(&pose), at.time);
                if let Ok(Some(guidance)) = outcome.as_ref().map(|outcome| outcome.guidance) {
                    out.publish(&GUIDANCE, GuidanceSample { full_solve_ns, ..guidance })?;
                }
                outcome
            }
            Taken::Idle => self.planner.step(Input::Idle, at.time),
            Taken::Target(target) => self.planner.step(Input::Target(&target), at.time),
            Taken::Solved(number) => {
                let solved = self.result_of(number);
                let took_ns = solved.took_ns;
                let outcome = self.planner.step(Input::Solved(solved), at.time);
                if outcome.as_ref().is_ok_and(|outcome| outcome.work == Work::SwappedIn) {
                    self.full_solve_ns = took_ns;
                }
                outcome
            }
            Taken::Fault(fault, robot) => self.planner.step(Input::Fault { fault, robot }, at.time),
            Taken::Field(part) => {
                self.publish_field(part, at, out)?;
                return Ok(Ok(Work::None));
            }
            Taken::Policy => {
                self.snapshot = self.planner.snapshot();
                return Ok(Ok(Work::None));
            }
        };
        Ok(outcome.map(|outcome| {
            if outcome.work == Work::Solved {
                self.full_solve_ns = began.elapsed().as_nanos() as u64;
            }
            self.jobs.extend(outcome.job);
            outcome.work
        }))
    }

    fn describe(Entry { taken, at }: &Entry<'_>) -> String {
        match taken {
            Taken::Grid((GridHeader { stamp, part, .. }, _)) => format!("Grid {stamp:?} {part:?}"),
            taken => format!("{taken:?} {at:?}"),
        }
    }
}

impl PlannerStage {
    /// A replay solves the jobs in their order, as the thread did.
    fn result_of(&mut self, number: u64) -> Solved {
        if let Some(solved) = self.solved.take() {
            return solved;
        }
        while let Some(job) = self.jobs.pop_front() {
            let solved = self.worker.solve(job);
            if solved.number == number {
                return solved;
            }
        }
        Solved { number, field: Err(SolveError::Cancelled), took_ns: 0 }
    }

    fn publish_field(
        &mut self,
        part: Part,
        at: Progress,
        out: &mut Outputs,
    ) -> Result<(), StageError> {
        if let Some(snapshot) = self.snapshot.take_if(|_| out.has_field()) {
            self.policy = Some(Policy::of(&snapshot));
        }
        let Some(policy) = self.policy.as_ref().filter(|it| it.frame.contains(part.window()))
        else {
            return Ok(());
        };
        out.publish_inputs()?;
        let now = std::mem::replace(&mut out.at, at);
        let cells = policy.frame.cells_of(part.window(), &policy.cells);
        out.publish_slice(&FIELD, FieldHeader { part, ..policy.header }, &cells)?;
        out.at = now;
        Ok(())
    }
}
