//! `pose`, `range` and `directive` in, `grid` out: a window for each change, a keyframe for each new reader and now and
//! then, nothing but a stamp otherwise, so that every tick goes on to the planner.

use std::time::Duration;

use common::{
    bus::{Reader, SliceWriter},
    clock::MissionTime,
    grid::Part,
    inputs::InputLog,
    journal::Journal,
    latency_budget::{Answers, Item, LatencyBudget},
    samples::{DirectiveSample, FaultKind, GridHeader, PoseSample, RangeSample},
    shell::{Context, Process, Progress, StageError},
    step::Step as _,
    topics,
};

use crate::{
    replay::{Entry, Start, sample_of},
    step::{Belief, Change, Input, Mapper},
};

/// Mission time after which the whole map is published again.
const KEYFRAME_EVERY: Duration = Duration::from_secs(1);

/// The mapper process.
#[derive(Debug)]
pub struct Shell {
    pose: Reader<PoseSample>,
    range: Reader<RangeSample>,
    directive: Reader<DirectiveSample>,
    grid: SliceWriter<GridHeader, u8>,
    journal: Journal,
    inputs: InputLog,
    mapper: Mapper,
    latest_range: Option<RangeSample>,
    last_keyframe: Option<MissionTime>,
    progress: Progress,
    budget: LatencyBudget,
}

impl Process for Shell {
    fn open(context: &mut Context) -> Result<Self, StageError> {
        let mut mapper = Mapper::new(&context.run.mission);
        let (journal, saved) =
            Journal::open::<Belief, Input>(&context.checkpoint_file(), mapper.saved_bytes())?;
        let inputs = InputLog::begin(
            context,
            &Start {
                belief: saved.state.as_ref(),
                inputs: &saved.entries,
            },
        )?;
        if let Some(Err(foreign)) = saved.state.map(|belief| mapper.restore(belief)) {
            tracing::warn!("{foreign}");
        }
        for input in saved.entries {
            mapper.step(input, MissionTime::default());
        }
        let version = mapper.state().version();
        if version > 1 {
            tracing::info!(version, "belief restored");
        }
        context.waiter.on(context.bus.wakeup(&topics::POSE)?);
        context.waiter.on(context.bus.wakeup(&topics::DIRECTIVE)?);
        // A planner that becomes ready is a new reader of the grid.
        context.waiter.on(context.bus.wakeup(&topics::HEALTH)?);
        let generation = context.generation.number;
        Ok(Self {
            pose: context.bus.reader(&topics::POSE)?,
            range: context.bus.reader(&topics::RANGE)?,
            directive: context.bus.reader(&topics::DIRECTIVE)?,
            grid: context
                .bus
                .slice_writer(&topics::GRID, generation, mapper.frame().area())?,
            journal,
            inputs,
            mapper,
            latest_range: None,
            last_keyframe: None,
            // Of no tick that is open: what is published before the first pose answers nobody.
            progress: Progress::default(),
            budget: context.budget.clone(),
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        while let Some(pose) = self.pose.take()? {
            let (tick, time) = (pose.stamp.tick, pose.stamp.time());
            let range = self.range_of(tick)?;
            self.progress = Progress { tick, time };
            self.take(Input::Tick { pose, range })?;
        }
        if let Some(DirectiveSample { epoch, .. }) = self.directive.newest()? {
            self.take(Input::Reset { epoch })?;
        }
        if self.grid.has_new_reader() {
            self.publish_again()?;
        }
        Ok(self.progress)
    }

    /// A belief that is wrong is wrong in its journal, too.
    fn inject(&mut self, fault: FaultKind) -> Result<bool, StageError> {
        let input = Input::Fault(fault);
        self.inputs
            .note(&Entry::Step(input, self.progress), self.progress)?;
        self.mapper.step(input, self.progress.time);
        self.journal.append(&input)?;
        Ok(true)
    }

    fn has_idle_work(&self) -> bool {
        self.is_keyframe_due() || self.journal.is_long()
    }

    /// What takes the time of the whole map.
    fn idle(&mut self) -> Result<(), StageError> {
        if self.is_keyframe_due() {
            self.publish_again()?;
        }
        if self.journal.is_long() {
            self.journal.snapshot(self.mapper.state())?;
        }
        Ok(())
    }
}

impl Shell {
    /// Step, save what happened, publish what changed.
    fn take(&mut self, input: Input) -> Result<(), StageError> {
        self.budget.end(Item::Read);
        self.inputs
            .note(&Entry::Step(input, self.progress), self.progress)?;
        self.budget.end(Item::Persist);
        let change = self.mapper.step(input, self.progress.time);
        self.budget.end(Item::Step);
        if change == Change::None {
            return Ok(());
        }
        if let Input::Reset { epoch } = input {
            tracing::warn!(epoch, "sensed belief reset");
        }
        self.journal.append(&input)?;
        match change {
            Change::Window(window) => {
                let version = self.mapper.state().version();
                self.publish(Part::of(self.mapper.frame(), window, version))
            }
            Change::Whole => self.publish(self.whole()),
            Change::None => Ok(()),
        }
    }

    /// The range sample of `tick`; those before it are dropped, one after it waits for its pose.
    fn range_of(&mut self, tick: u64) -> Result<Option<RangeSample>, StageError> {
        while self
            .latest_range
            .is_none_or(|range| range.stamp.tick < tick)
        {
            match self.range.take()? {
                Some(range) => self.latest_range = Some(range),
                None => break,
            }
        }
        Ok(self.latest_range.filter(|range| range.stamp.tick == tick))
    }

    fn is_keyframe_due(&self) -> bool {
        let due = |last| self.progress.time.since(last) >= KEYFRAME_EVERY;
        self.last_keyframe.is_none_or(due)
    }

    /// Publish the whole map although nothing changed.
    fn publish_again(&mut self) -> Result<(), StageError> {
        self.inputs
            .note(&Entry::Again(self.progress), self.progress)?;
        self.publish(self.whole())
    }

    fn whole(&self) -> Part {
        Part::whole(self.mapper.frame(), self.mapper.state().version())
    }

    fn publish(&mut self, part: Part) -> Result<(), StageError> {
        let Progress { tick, time } = self.progress;
        if part.is_keyframe() {
            self.last_keyframe = Some(time);
        }
        self.inputs.publish(self.progress)?;
        self.budget.end(Item::Persist);
        if part.is_keyframe() {
            let header = self.mapper.header(part);
            let cells = self.mapper.state().cells();
            self.grid.publish_slice_quietly(tick, time, header, cells)?;
        } else {
            let (header, cells) = sample_of(&self.mapper, part);
            self.grid.publish_quietly(tick, time, header, cells)?;
        }
        self.budget.published(tick, Answers::Inputs);
        self.grid.wake()?;
        Ok(())
    }
}
