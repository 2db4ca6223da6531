//! Planner process: reads `grid`, `pose` and `target`, publishes `guidance` each tick and `field`
//! on changes.

use std::borrow::Cow;

use common::{
    bus::Reader,
    clock::MissionClock,
    readers,
    samples::{BaseResponseSample, CommandSample, FaultKind, GridHeader, PoseSample},
    shell::{Context, Process, Progress},
    stage::Runner,
    start::{Result, StageError},
    target::TargetReader,
    topics::{BASE_RESPONSE, COMMAND, FIELD, GRID, GUIDANCE, POSE, TARGET},
    wiring::Topics,
};

use crate::{
    background::Background,
    background_solver::Worker,
    field_publisher::FieldPublisher,
    stage::{Entry, PlannerStage, Taken},
    step::{Job, Solved, Work},
};

readers! {
    pub struct Inputs {
        inputs {
            pose: Reader<PoseSample> = POSE,
            grid: Reader<GridHeader, u8> = GRID,
            target: TargetReader = TARGET,
        }
        feedback {
            response: Reader<BaseResponseSample> = BASE_RESPONSE,
            commands: Reader<CommandSample> = COMMAND,
        }
    }
}

pub struct Shell {
    inputs: Inputs,
    /// Without a target, no grid counts as followed.
    has_target: bool,
    runner: Runner<PlannerStage>,
    background: Background<Job, Solved>,
    field: FieldPublisher,
    lockstep: bool,
    /// Last job and its tick in lockstep, until its result is taken.
    job: Option<(u64, u64)>,
    latest_pose: Option<PoseSample>,
    answered: Option<u64>,
    field_changed: bool,
}

impl Process for Shell {
    const NAME: &'static str = "planner";
    const WAKES: Topics = &[&GRID];
    const OUTPUTS: Topics = &[&GUIDANCE, &FIELD];
    type Readers = Inputs;

    fn open(context: &mut Context, inputs: Inputs) -> Result<Self> {
        let no_thread = |error| StageError::Other(format!("cannot start a thread: {error}"));
        let background = Worker::on_a_thread().map_err(no_thread)?;
        // In lockstep, a due result is awaited instead.
        let lockstep = matches!(context.run.clock, MissionClock::Ticks { .. });
        let field = FieldPublisher::start().map_err(no_thread)?;
        let solved = background.descriptor().filter(|_| !lockstep);
        for descriptor in solved.into_iter().chain(field.descriptor()) {
            context.waiter.on_readable(descriptor)?;
        }
        let cells = context.run.mission.grid_frame().area();
        Ok(Self {
            runner: Runner::open(context, |_| cells)?,
            inputs,
            has_target: false,
            background,
            field,
            lockstep,
            job: None,
            latest_pose: None,
            answered: None,
            field_changed: false,
        })
    }

    fn turn(&mut self) -> Result<Progress> {
        let knew_target = self.has_target;
        if !knew_target {
            self.take_target(0)?;
        }
        let asked = self.follow_grid()?;
        let swapped = self.take_solved()?;
        if asked && self.lockstep {
            // A robot that waits for its command takes only one per tick.
            self.take(Taken::Idle)?;
        }
        if asked || swapped && !self.lockstep {
            self.answer()?;
        }
        if self.field.busy {
            self.publish_field()?;
        }
        if !knew_target && self.has_target {
            // A target wakes no process, and the first field may follow from it.
            self.idle()?;
        }
        Ok(if self.has_target { self.runner.out.at } else { Progress::default() })
    }

    fn inject(&mut self, fault: FaultKind) -> Result<bool> {
        let robot = self.latest_pose.unwrap_or_default().pose().position;
        Ok(self.take(Taken::Fault(fault, robot))?.changed())
    }

    /// Returns true, because a new reader may wait for the field.
    fn has_idle_work(&self) -> bool {
        true
    }

    fn idle(&mut self) -> Result {
        let work = self.take(Taken::Idle)?;
        if work == Work::Solved && !self.lockstep {
            self.answer()?;
        }
        while let Some(job) = self.runner.stage.jobs.pop_front() {
            tracing::debug!(number = job.number, "background solve begins");
            self.job = Some((job.number, self.runner.out.at.tick));
            self.background.begin(job);
        }
        self.publish_field()
    }
}

impl Shell {
    fn take(&mut self, taken: Taken<'_>) -> Result<Work> {
        self.take_at(taken, self.runner.out.at)
    }

    fn take_at(&mut self, taken: Taken<'_>, at: Progress) -> Result<Work> {
        let work = self.runner.take_entry(Entry { taken, at })?;
        let work = work.map_err(|error| StageError::Other(format!("no field: {error}")))?;
        self.field_changed |= work.changed();
        if matches!(work, Work::Solved | Work::SwappedIn) {
            let took_us = self.runner.stage.full_solve_ns / 1000;
            tracing::debug!(took_us, ?work, "full solve");
        }
        Ok(work)
    }

    /// Takes the solver's results and returns whether the field changed.
    ///
    /// In lockstep, a result is taken exactly one tick after its job began, for repeatable runs.
    fn take_solved(&mut self) -> Result<bool> {
        let tick = self.runner.out.at.tick;
        let due = self.job.take_if(|(_, began)| self.lockstep && tick > *began);
        let mut swapped = false;
        loop {
            let solved = match due {
                Some(_) => self.background.wait(),
                None if self.lockstep => None,
                None => self.background.take(),
            };
            let Some(solved) = solved else {
                return Ok(swapped);
            };
            let number = solved.number;
            self.runner.stage.solved = Some(solved);
            swapped |= self.take(Taken::Solved(number))? == Work::SwappedIn;
            if due.is_some_and(|(last, _)| last == number) {
                return Ok(swapped);
            }
        }
    }

    fn take_target(&mut self, tick: u64) -> Result {
        if let Some(target) = self.inputs.target.next(tick)? {
            self.has_target = true;
            let work = self.take(Taken::Target(target))?;
            let (number, at) = (target.number, target.target);
            tracing::info!(number, x_m = at.x_m, y_m = at.y_m, ?work, "target");
        }
        Ok(())
    }

    fn follow_grid(&mut self) -> Result<bool> {
        let mut asked = false;
        while let Some(grid) = self.inputs.grid.next_slice()? {
            let GridHeader { stamp, part, .. } = *grid.header();
            self.take_target(stamp.tick)?;
            let work = self.take(Taken::Grid((*grid.header(), Cow::Borrowed(&grid))))?;
            if work == Work::Missed {
                tracing::warn!(version = part.version, "missed a grid version");
                continue;
            }
            // A repeated keyframe of an answered tick needs an answer only if it changes the field.
            asked |= part.keyframe == 0 || self.answered != Some(stamp.tick) || work != Work::None;
            self.runner.out.at = Progress::of(&stamp);
        }
        Ok(asked)
    }

    /// The tick's pose is published before its grid.
    fn answer(&mut self) -> Result {
        self.latest_pose = self.inputs.pose.newest()?.or(self.latest_pose);
        // A keyframe for new readers may belong to a past tick.
        let tick = self.runner.out.at.tick;
        if let Some(pose) = self.latest_pose.filter(|pose| pose.stamp.tick == tick) {
            if let Some(response) = self.inputs.response.newest()? {
                self.take(Taken::Response(response.into()))?;
            }
            while let Some(command) = self.inputs.commands.next_sample()? {
                if self.runner.stage.planner.foresees() {
                    self.take(Taken::Command(command))?;
                }
            }
            let full_solve_ns = self.runner.stage.full_solve_ns;
            self.take(Taken::Pose { pose, full_solve_ns })?;
            self.answered = Some(tick);
        }
        Ok(())
    }

    fn publish_field(&mut self) -> Result {
        let Runner { stage, out } = &mut self.runner;
        let (now, has_new_reader) = (out.at, out.has_new_reader(&FIELD)?);
        if let Some((part, at)) = self.field.next(now, has_new_reader, &mut stage.policy) {
            self.take_at(Taken::Field(part), at)?;
        }
        if self.field.is_due(self.field_changed, now.time) {
            self.take(Taken::Policy)?;
            if let Some(snapshot) = self.runner.stage.snapshot.take() {
                self.field_changed = false;
                self.field.begin(snapshot, now);
            }
        }
        Ok(())
    }
}
