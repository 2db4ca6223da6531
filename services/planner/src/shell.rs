//! The planner's process: reads `grid` and `pose`, publishes `guidance` each tick and `field` when it changes.

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
    wiring::Wiring,
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
    lockstep: bool,
    /// In lockstep: the job begun last and the tick at which it began, until its result is taken.
    job: Option<(u64, u64)>,
    latest_pose: Option<PoseSample>,
    /// The last tick that was answered.
    answered: Option<u64>,
    full_solve_ns: u64,
    field_changed: bool,
    progress: Progress,
    budget: LatencyBudget,
}

impl Process for Shell {
    const WIRING: &'static Wiring = &Wiring {
        inputs: &[&topics::POSE, &topics::GRID],
        wakes: &[&topics::GRID],
        outputs: &[&topics::GUIDANCE, &topics::FIELD],
        ..Wiring::of("planner")
    };

    fn open(context: &mut Context) -> Result<Self, StageError> {
        let longest = context.run.mission.grid_frame().area();
        let background = BackgroundSolver::start().map_err(|error| {
            StageError::Other(format!("cannot start the thread of full solves: {error}"))
        })?;
        context.waiter.on_readable(&background)?;
        let field = context.slice_writer(&topics::FIELD, longest)?;
        let field = FieldPublisher::start(field).map_err(|error| {
            StageError::Other(format!("cannot start the thread of policies: {error}"))
        })?;
        context.waiter.on_readable(&field)?;
        Ok(Self {
            grid: context.slice_reader(&topics::GRID)?,
            pose: context.reader(&topics::POSE)?,
            guidance: context.writer(&topics::GUIDANCE)?,
            field,
            planner: Planner::new(&context.run.mission),
            background,
            inputs: InputLog::begin(context, &())?,
            encoded: Vec::new(),
            lockstep: matches!(context.run.clock, MissionClock::Ticks { .. }),
            job: None,
            latest_pose: None,
            answered: None,
            full_solve_ns: 0,
            field_changed: false,
            progress: Progress::default(),
            budget: context.budget.clone(),
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        let asked = self.follow_grid()?;
        let swapped = self.take_solved()?;
        if asked || swapped && !self.lockstep {
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

    /// A new reader of the field may be waiting for it; that is not known before.
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
    /// Take the results of the background solver. Says whether the field is another now.
    ///
    /// In lockstep the result of a job is taken one tick after the job began, no sooner and no later, so that a run can be
    /// repeated.
    fn take_solved(&mut self) -> Result<bool, StageError> {
        let mut swapped = false;
        if !self.lockstep {
            while let Some(solved) = self.background.take() {
                swapped |= self.swap_in(solved)?;
            }
            return Ok(swapped);
        }
        let due = self.job.take_if(|(_, began)| self.progress.tick > *began);
        let Some((number, _)) = due else {
            return Ok(false);
        };
        while let Some(solved) = self.background.wait() {
            let last = solved.number == number;
            swapped |= self.swap_in(solved)?;
            if last {
                break;
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

    /// Begin the background solve that is due, if any.
    fn begin_background_solve(&mut self) -> Result<(), StageError> {
        self.note(Taken::Idle)?;
        let outcome = self.planner.step(Input::Idle, self.progress.time);
        if let Some(job) = outcome.map_err(no_field)?.job {
            tracing::debug!(number = job.number, "background solve begins");
            self.job = Some((job.number, self.progress.tick));
            self.background.begin(job);
        }
        Ok(())
    }

    fn swap_in(&mut self, solved: Solved) -> Result<bool, StageError> {
        let took_ns = solved.took_ns;
        self.note(Taken::Solved(solved.number))?;
        let swapped = self.work(Input::Solved(solved))? == Work::SwappedIn;
        if swapped {
            self.full_solve_ns = took_ns;
            tracing::debug!(took_us = took_ns / 1000, "background solve swapped in");
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
            let work = self.work(Input::Grid { header: grid.header(), cells: &grid })?;
            let took_ns = began.elapsed().as_nanos() as u64;
            self.budget.end(Item::Step);
            match work {
                Work::Missed => {
                    tracing::warn!(version = part.version, "missed a grid version");
                    continue;
                }
                Work::Solved => {
                    self.full_solve_ns = took_ns;
                    tracing::debug!(took_us = took_ns / 1000, "full solve");
                }
                Work::None | Work::Stale | Work::SwappedIn | Work::Broken => {}
            }
            // A keyframe published again after its tick was answered needs no answer, unless it changes the field.
            asked |= part.keyframe == 0 || self.answered != Some(stamp.tick) || work != Work::None;
            self.progress = Progress { tick: stamp.tick, time: stamp.time() };
        }
        Ok(asked)
    }

    /// Guidance for the pose of the tick, which was published before the grid was.
    fn answer(&mut self) -> Result<(), StageError> {
        if let Some(pose) = self.pose.newest()? {
            self.latest_pose = Some(pose);
        }
        // A keyframe for new readers may belong to a tick that is over.
        let tick = self.progress.tick;
        let Some(pose) = self.latest_pose.filter(|pose| pose.stamp.tick == tick) else {
            return Ok(());
        };
        let Progress { tick, time } = self.progress;
        let full_solve_ns = self.full_solve_ns;
        self.budget.end(Item::Read);
        self.note(Taken::Pose { pose, full_solve_ns })?;
        self.budget.end(Item::Persist);
        let outcome = self.planner.step(Input::Pose(&pose), time);
        self.budget.end(Item::Step);
        if let Some(guidance) = outcome.map_err(no_field)?.guidance {
            let guidance = GuidanceSample { full_solve_ns, ..guidance };
            self.inputs.publish(self.progress)?;
            self.budget.end(Item::Persist);
            self.guidance.publish_quietly(tick, time, guidance)?;
            self.budget.published(tick, Answers::Inputs);
            self.guidance.wake()?;
        }
        self.answered = Some(tick);
        Ok(())
    }

    /// Publish the field for consumers, after the robot has its guidance.
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
