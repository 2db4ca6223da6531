//! Planner as a stage: records and publications.

use std::{borrow::Cow, collections::VecDeque};

use common::{
    clock::Instant,
    found_response::FoundResponse,
    grid::Part,
    inputs,
    mission::Mission,
    outputs::Outputs,
    samples::{
        CommandSample, FaultKind, FieldHeader, GridHeader, GuidanceSample, PoseSample, TargetSample,
    },
    shell::{Context, Progress},
    stage::{ForeignState, Stage},
    start::Result,
    topics::{FIELD, GUIDANCE},
};
use glam::DVec2;
use harmonic::SolveError;
use serde::{Deserialize, Serialize};

use crate::{
    background_solver::Worker,
    field_publisher::Policy,
    step::{Job, Planner, Snapshot, Solved, Work},
};

#[derive(Debug, Serialize, Deserialize)]
pub struct Entry<'a> {
    #[serde(borrow)]
    pub(crate) taken: Taken<'a>,
    pub(crate) at: Progress,
}

#[derive(Debug, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "there is one at a time, on the stack")]
pub(crate) enum Taken<'a> {
    Grid(#[serde(with = "inputs::slice")] (GridHeader, Cow<'a, [u8]>)),
    Pose {
        #[serde(with = "inputs::sample")]
        pose: PoseSample,
        /// Time of the last full solve, for the guidance.
        full_solve_ns: u64,
    },
    Idle,
    Solved(u64),
    /// Fault, and the position of the robot, metres.
    Fault(FaultKind, DVec2),
    /// Part of the newest policy to publish.
    Field(#[serde(with = "inputs::sample")] Part),
    Policy,
    Target(#[serde(with = "inputs::sample")] TargetSample),
    Response(FoundResponse),
    /// Command, taken only if the base answers late.
    Command(#[serde(with = "inputs::sample")] CommandSample),
}

/// Step and its outside computations.
///
/// Threads take the jobs and return results; in a replay, this thread solves them.
pub struct PlannerStage {
    pub(crate) planner: Planner,
    pub(crate) jobs: VecDeque<Job>,
    pub(crate) solved: Option<Solved>,
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

    fn start(&self, _: &mut Context) -> Result {
        Ok(())
    }

    fn begin(&mut self, (): ()) -> Result<(), ForeignState> {
        Ok(())
    }

    fn take_entry(
        &mut self,
        Entry { taken, at }: Entry<'_>,
        out: &mut Outputs,
    ) -> Result<Self::Outcome> {
        let began = Instant::now();
        let planner = &mut self.planner;
        let outcome = match taken {
            Taken::Grid((header, cells)) => planner.take_grid(&header, &cells),
            Taken::Pose { pose, full_solve_ns } => {
                out.at = at;
                let answered = planner.answer(&pose);
                if let Ok((_, guidance)) = answered {
                    out.publish(&GUIDANCE, GuidanceSample { full_solve_ns, ..guidance })?;
                }
                answered.map(|(work, _)| work)
            }
            Taken::Idle => planner.end_tick().map(|(work, job)| {
                self.jobs.extend(job);
                work
            }),
            Taken::Command(command) => Ok(planner.take_command(&command)),
            Taken::Response(found) => Ok(planner.take_response(&found)),
            Taken::Target(target) => planner.take_target(&target),
            Taken::Solved(number) => {
                let solved = self.result_of(number);
                let took_ns = solved.took_ns;
                let outcome = self.planner.swap_in(solved);
                if outcome == Ok(Work::SwappedIn) {
                    self.full_solve_ns = took_ns;
                }
                outcome
            }
            Taken::Fault(fault, robot) => Ok(planner.corrupt(fault, robot)),
            Taken::Field(part) => {
                self.publish_field(part, at, out)?;
                Ok(Work::None)
            }
            Taken::Policy => {
                self.snapshot = planner.snapshot();
                Ok(Work::None)
            }
        };
        if outcome == Ok(Work::Solved) {
            self.full_solve_ns = began.elapsed().as_nanos() as u64;
        }
        Ok(outcome)
    }

    fn describe(Entry { taken, at }: &Entry<'_>) -> String {
        match taken {
            Taken::Grid((GridHeader { stamp, part, .. }, _)) => format!("Grid {stamp:?} {part:?}"),
            taken => format!("{taken:?} {at:?}"),
        }
    }
}

impl PlannerStage {
    /// Returns the result of a job; a replay solves the jobs in the order of the thread.
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

    fn publish_field(&mut self, part: Part, at: Progress, out: &mut Outputs) -> Result {
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
