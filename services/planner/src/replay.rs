//! Replay of the planner: the step, fed with the recorded inputs. The jobs of the background solver are solved again, in the
//! recorded order.

use std::collections::VecDeque;

use common::{
    bus::decode_slice,
    grid::{GridFrame, Part},
    inputs,
    replay::{Beginning, Output, Replay, ReplayError, entry},
    samples::{FaultKind, FieldCell, FieldHeader, GridHeader, GuidanceSample, PoseSample},
    shell::Progress,
    step::Step as _,
    topics,
};
use glam::DVec2;
use harmonic::SolveError;
use serde::{Deserialize, Serialize};

use crate::{
    background_solver::Worker,
    step::{Input, Job, Outcome, Planner, Solved},
};

/// An action of the planner, and its tick.
#[derive(Debug, Serialize, Deserialize)]
pub struct Entry<'a> {
    #[serde(borrow)]
    pub taken: Taken<'a>,
    pub at: Progress,
}

/// An action of the planner.
#[derive(Debug, Serialize, Deserialize)]
pub enum Taken<'a> {
    /// The step takes a sample of `grid`, encoded.
    Grid(#[serde(with = "serde_bytes")] &'a [u8]),
    /// The step takes the pose of the tick.
    Pose {
        #[serde(with = "inputs::sample")]
        pose: PoseSample,
        /// Wall-clock of the last full solve, nanoseconds, which the shell adds to the guidance.
        full_solve_ns: u64,
    },
    /// The step is asked for a job.
    Idle,
    /// The step takes the result of the job with this number.
    Solved(u64),
    /// The step takes a fault for the robot here, metres.
    Fault(FaultKind, DVec2),
    /// This part of the policy is published.
    Field(#[serde(with = "inputs::sample")] Part),
    /// The policy is computed from the field as it is here.
    Policy,
}

struct Generation {
    planner: Planner,
    worker: Worker,
    /// Jobs whose results are not taken yet, oldest first.
    jobs: VecDeque<Job>,
    fields: bool,
    policy: Option<Policy>,
}

/// The policy computed last.
struct Policy {
    header: FieldHeader,
    frame: GridFrame,
    cells: Vec<FieldCell>,
}

/// Begin the replay of a generation.
pub fn begin(beginning: Beginning<'_>) -> Result<Box<dyn Replay>, ReplayError> {
    Ok(Box::new(Generation {
        planner: Planner::new(&beginning.run.mission),
        worker: Worker::default(),
        jobs: VecDeque::new(),
        fields: beginning.fields,
        policy: None,
    }))
}

impl Generation {
    /// The result of job `number`, as the background solver gave it: results come in the order of the jobs.
    fn solved(&mut self, number: u64) -> Solved {
        while let Some(job) = self.jobs.pop_front() {
            let solved = self.worker.solve(job);
            if solved.number == number {
                return solved;
            }
        }
        Solved { number, field: Err(SolveError::Cancelled), took_ns: 0 }
    }

    fn policy(&self) -> Option<Policy> {
        let snapshot = self.planner.snapshot().filter(|_| self.fields)?;
        Some(Policy { header: snapshot.header, frame: snapshot.frame, cells: snapshot.cells() })
    }

    fn field(&self, part: Part, at: Progress) -> Option<Output> {
        let policy = self.policy.as_ref()?;
        let header = FieldHeader { part, ..policy.header };
        let window = policy.frame.cells_of(part.window(), &policy.cells);
        let window: Vec<_> = window.collect();
        let (tick, time) = (at.tick, at.time);
        let topic = &topics::FIELD;
        Some(Output::of_slice(topic, tick, time, header, &window))
    }
}

impl Replay for Generation {
    fn take(&mut self, body: &[u8]) -> Result<Vec<Output>, ReplayError> {
        let Entry { taken, at } = entry(body)?;
        let Progress { tick, time } = at;
        let outcome = match taken {
            Taken::Grid(message) => {
                let Some((header, cells)) = decode_slice::<GridHeader, u8>(message) else {
                    return Err(ReplayError::Sample("grid"));
                };
                let (header, cells) = (&header, &cells[..]);
                self.planner.step(Input::Grid { header, cells }, time)
            }
            Taken::Pose { pose, full_solve_ns } => {
                let outcome = self.planner.step(Input::Pose(&pose), time);
                let guidance = outcome.ok().and_then(|outcome| outcome.guidance);
                let published = guidance.map(|guidance| {
                    let guidance = GuidanceSample { full_solve_ns, ..guidance };
                    Output::of(&topics::GUIDANCE, tick, time, guidance)
                });
                return Ok(published.into_iter().collect());
            }
            Taken::Idle => self.planner.step(Input::Idle, time),
            Taken::Solved(number) => {
                let solved = self.solved(number);
                self.planner.step(Input::Solved(solved), time)
            }
            Taken::Fault(fault, robot) => self.planner.step(Input::Fault { fault, robot }, time),
            Taken::Field(part) => return Ok(self.field(part, at).into_iter().collect()),
            Taken::Policy => {
                self.policy = self.policy();
                return Ok(Vec::new());
            }
        };
        // On an error the process ended.
        if let Ok(Outcome { job: Some(job), .. }) = outcome {
            self.jobs.push_back(job);
        }
        Ok(Vec::new())
    }

    fn describe(&self, body: &[u8]) -> Result<String, ReplayError> {
        let Entry { taken, at } = entry(body)?;
        Ok(match taken {
            Taken::Grid(message) => match decode_slice::<GridHeader, u8>(message) {
                Some((GridHeader { stamp, part, .. }, _)) => format!("Grid {stamp:?} {part:?}"),
                None => return Err(ReplayError::Sample("grid")),
            },
            taken => format!("{taken:?} {at:?}"),
        })
    }
}
