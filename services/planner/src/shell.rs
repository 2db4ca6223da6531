//! `grid` and `pose` in; `guidance` each tick, `field` at every change and now and then.

use std::time::Instant;

use common::{
    bus::{Reader, SliceReader, Writer, encode_slice},
    clock::MissionClock,
    inputs::InputLog,
    latency_budget::{Answers, Item, LatencyBudget},
    samples::{FaultKind, GridHeader, GuidanceSample, PoseSample},
    shell::{Context, Process, Progress, StageError},
    step::Step as _,
    topics,
};

use harmonic::SolveError;

use crate::{
    background_solver::BackgroundSolver,
    field_publisher::FieldPublisher,
    replay::{Entry, Taken},
    step::{Input, Planner, Solved, Work},
};

/// The planner process.
#[derive(Debug)]
pub struct Shell {
    grid: SliceReader<GridHeader, u8>,
    pose: Reader<PoseSample>,
    guidance: Writer<GuidanceSample>,
    field: FieldPublisher,
    planner: Planner,
    background: BackgroundSolver,
    inputs: InputLog,
    /// A grid sample, encoded.
    encoded: Vec<u8>,
    /// in lockstep, the tick at which the job that runs is swapped in.
    swap_at: Option<u64>,
    in_ticks: bool,
    latest_pose: Option<PoseSample>,
    /// The tick last answered.
    answered: Option<u64>,
    full_solve_ns: u64,
    local_update_ns: u64,
    field_changed: bool,
    progress: Progress,
    budget: LatencyBudget,
}

impl Process for Shell {
    fn open(context: &mut Context) -> Result<Self, StageError> {
        let generation = context.generation.number;
        let mission = &context.run.mission;
        let longest = mission.grid_frame().area();
        context.waiter.on(context.bus.wakeup(&topics::GRID)?);
        let background = BackgroundSolver::start().map_err(|error| {
            StageError::Other(format!("cannot start the thread of full solves: {error}"))
        })?;
        context.waiter.on_readable(&background)?;
        let field = context
            .bus
            .slice_writer(&topics::FIELD, generation, longest)?;
        let field = FieldPublisher::start(field).map_err(|error| {
            StageError::Other(format!("cannot start the thread of policies: {error}"))
        })?;
        context.waiter.on_readable(&field)?;
        Ok(Self {
            grid: context.bus.slice_reader(&topics::GRID)?,
            pose: context.bus.reader(&topics::POSE)?,
            guidance: context.bus.writer(&topics::GUIDANCE, generation)?,
            field,
            planner: Planner::new(mission),
            background,
            inputs: InputLog::begin(context, &())?,
            encoded: Vec::new(),
            swap_at: None,
            in_ticks: matches!(context.run.clock, MissionClock::Ticks { .. }),
            latest_pose: None,
            answered: None,
            full_solve_ns: 0,
            local_update_ns: 0,
            field_changed: false,
            progress: Progress::default(),
            budget: context.budget.clone(),
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        let asked = self.follow_grid()?;
        let swapped = self.swap_in_what_is_due()?;
        if asked || swapped && !self.in_ticks {
            self.answer()?;
        }
        if self.field.is_busy() {
            self.publish_field()?;
        }
        Ok(self.progress)
    }

    fn inject(&mut self, fault: FaultKind) -> Result<bool, StageError> {
        let robot = self.latest_pose.unwrap_or_default().pose().position;
        self.note(Taken::Fault(fault, robot))?;
        Ok(self.work(Input::Fault { fault, robot })?.changed())
    }

    /// Whether there is a new reader of the field is not known before.
    fn has_idle_work(&self) -> bool {
        true
    }

    fn idle(&mut self) -> Result<(), StageError> {
        self.begin_background_solve()?;
        self.publish_field()
    }
}

#[allow(clippy::needless_pass_by_value, reason = "the shape map_err wants")]
fn no_field(error: SolveError) -> StageError {
    StageError::Other(format!("no field: {error}"))
}

impl Shell {
    /// Swap in what the background solver gave. Says whether there was anything.
    fn swap_in_what_is_due(&mut self) -> Result<bool, StageError> {
        let tick = self.progress.tick;
        let mut swapped = false;
        if self.planner.running_job().is_none() {
            self.swap_at = None;
        }
        if !self.in_ticks {
            while let Some(solved) = self.background.take() {
                swapped |= self.swap_in(solved)?;
            }
        } else if self.swap_at.is_some_and(|at| tick >= at) {
            self.swap_at = None;
            let number = self.planner.running_job();
            while let Some(solved) = self.background.wait() {
                let awaited = Some(solved.number) == number;
                swapped |= self.swap_in(solved)?;
                if awaited {
                    break;
                }
            }
        }
        Ok(swapped)
    }

    fn note(&mut self, taken: Taken<'_>) -> Result<(), StageError> {
        let at = self.progress;
        self.inputs.note(&Entry { taken, at }, at)
    }

    /// An input that may change the field.
    fn work(&mut self, input: Input<'_>) -> Result<Work, StageError> {
        let outcome = self.planner.step(input, self.progress.time);
        let work = outcome.map_err(no_field)?.work;
        self.field_changed |= work.changed();
        Ok(work)
    }

    /// Begin the full solve that is called for, if one is.
    fn begin_background_solve(&mut self) -> Result<(), StageError> {
        self.note(Taken::Idle)?;
        let outcome = self.planner.step(Input::Idle, self.progress.time);
        if let Some(job) = outcome.map_err(no_field)?.job {
            let (number, urgent) = (job.number, job.urgent);
            tracing::debug!(number, urgent, "full solve begins");
            self.swap_at = Some(self.progress.tick + job.swap_after_ticks());
            self.background.begin(job);
        }
        Ok(())
    }

    fn swap_in(&mut self, solved: Solved) -> Result<bool, StageError> {
        let took_ns = solved.took_ns;
        let cancelled = matches!(solved.result, Err(SolveError::Cancelled));
        self.note(Taken::Solved(solved.number, cancelled))?;
        let swapped = self.work(Input::Solved(solved))? == Work::SwappedIn;
        if swapped {
            self.full_solve_ns = took_ns;
        }
        Ok(swapped)
    }

    /// Follow every grid sample that came. Says whether an answer is due.
    fn follow_grid(&mut self) -> Result<bool, StageError> {
        let mut asked = false;
        while let Some(grid) = self.grid.take()? {
            let GridHeader { stamp, part, .. } = *grid.header();
            self.budget.end(Item::Read);
            self.encoded.clear();
            encode_slice(grid.header(), &grid, &mut self.encoded);
            let at = self.progress;
            let taken = Taken::Grid(&self.encoded);
            self.inputs.note(&Entry { taken, at }, at)?;
            self.budget.end(Item::Persist);
            let began = Instant::now();
            let work = self.work(Input::Grid {
                header: grid.header(),
                cells: &grid,
            })?;
            let took_ns = began.elapsed().as_nanos() as u64;
            self.budget.end(Item::Step);
            match work {
                Work::Missed => {
                    tracing::warn!(version = part.version, "missed a grid version");
                    continue;
                }
                Work::FullSolve => {
                    self.full_solve_ns = took_ns;
                    tracing::debug!(took_us = took_ns / 1000, "full solve");
                }
                Work::LocalUpdate => self.local_update_ns = took_ns,
                Work::None | Work::SwappedIn | Work::Broken => {}
            }
            // The whole map, published again behind the tick it belongs to, asks for nothing; a tick that is
            // given again was not answered to the end.
            asked |= part.keyframe == 0 || self.answered != Some(stamp.tick) || work != Work::None;
            self.progress = Progress {
                tick: stamp.tick,
                time: stamp.time(),
            };
        }
        Ok(asked)
    }

    /// Guidance for the pose of the tick, which was published before the grid was.
    fn answer(&mut self) -> Result<(), StageError> {
        if let Some(pose) = self.pose.newest()? {
            self.latest_pose = Some(pose);
        }
        // A grid for new readers may be of a tick that is over.
        let tick = self.progress.tick;
        let Some(pose) = self.latest_pose.filter(|pose| pose.stamp.tick == tick) else {
            return Ok(());
        };
        let Progress { tick, time } = self.progress;
        let (full_solve_ns, local_update_ns) = (self.full_solve_ns, self.local_update_ns);
        self.budget.end(Item::Read);
        self.note(Taken::Pose {
            pose,
            full_solve_ns,
            local_update_ns,
        })?;
        self.budget.end(Item::Persist);
        let outcome = self.planner.step(Input::Pose(&pose), time);
        self.budget.end(Item::Step);
        if let Some(guidance) = outcome.map_err(no_field)?.guidance {
            let guidance = GuidanceSample {
                full_solve_ns,
                local_update_ns,
                ..guidance
            };
            self.inputs.publish(self.progress)?;
            self.budget.end(Item::Persist);
            self.guidance.publish_quietly(tick, time, guidance)?;
            self.budget.published(tick, Answers::Inputs);
            self.guidance.wake()?;
        }
        self.answered = Some(tick);
        Ok(())
    }

    /// The field for consumers, after the robot has its guidance.
    fn publish_field(&mut self) -> Result<(), StageError> {
        if let Some((part, at)) = self.field.next(self.progress) {
            let taken = Taken::Field(part);
            self.inputs.note(&Entry { taken, at }, self.progress)?;
            self.inputs.publish(self.progress)?;
            self.field.publish(part, at)?;
        }
        if self.field.is_due(self.field_changed, self.progress.time)
            && let Some(snapshot) = self.planner.snapshot()
        {
            self.field_changed = false;
            self.note(Taken::Policy)?;
            self.field.begin(snapshot, self.progress);
        }
        Ok(())
    }
}
