//! `pose` and `range` in, `grid` out: a window for each change, a keyframe for each newcomer and now and
//! then, nothing but a stamp otherwise, so that every tick goes on to the planner.

use std::time::Duration;

use common::{
    bus::{Reader, SliceWriter},
    clock::MissionTime,
    grid::{Revision, Window},
    journal::Journal,
    samples::{DirectiveSample, FaultKind, GridHeader, PoseSample, RangeSample},
    shell::{Context, Process, Progress, StageError},
    topics,
};

use serde::{Deserialize, Serialize};

use crate::step::{Belief, Mapper};

/// Mission time after which the whole map is said again.
const KEYFRAME_EVERY: Duration = Duration::from_secs(1);

/// What a belief is made of; a new life makes it again.
#[derive(Debug, Serialize, Deserialize)]
enum Event {
    /// A tick was mapped.
    Tick {
        /// Where the robot was.
        pose: PoseSample,
        /// What it heard.
        range: Option<RangeSample>,
    },
    /// What was sensed was forgotten.
    Forget {
        /// The epoch that began.
        epoch: u64,
    },
    /// It was broken on purpose.
    Fault(FaultKind),
}

/// The mapper process.
#[derive(Debug)]
pub struct Shell {
    pose: Reader<PoseSample>,
    range: Reader<RangeSample>,
    directive: Reader<DirectiveSample>,
    grid: SliceWriter<GridHeader, u8>,
    journal: Journal,
    mapper: Mapper,
    latest_range: Option<RangeSample>,
    last_keyframe: Option<MissionTime>,
    progress: Progress,
}

impl Process for Shell {
    fn open(context: &mut Context) -> Result<Self, StageError> {
        let mut mapper = Mapper::new(&context.run.mission);
        let (journal, kept) =
            Journal::open::<Belief, Event>(&context.checkpoint_file(), mapper.kept_bytes())?;
        if kept.state.is_some_and(|belief| !mapper.restore(belief)) {
            tracing::warn!("the kept belief is of another map; starting from the perimeter");
        }
        for event in &kept.entries {
            match event {
                Event::Tick { pose, range } => {
                    mapper.step(pose, range.as_ref());
                }
                Event::Forget { epoch } => {
                    mapper.forget(*epoch);
                }
                Event::Fault(fault) => mapper.inject(*fault),
            }
        }
        let version = mapper.belief().version();
        if version > 1 {
            tracing::info!(version, "belief restored");
        }
        context.waiter.on(context.bus.wakeup(&topics::POSE)?);
        context.waiter.on(context.bus.wakeup(&topics::DIRECTIVE)?);
        let generation = context.generation.number;
        Ok(Self {
            pose: context.bus.reader(&topics::POSE)?,
            range: context.bus.reader(&topics::RANGE)?,
            directive: context.bus.reader(&topics::DIRECTIVE)?,
            grid: context
                .bus
                .slice_writer(&topics::GRID, generation, mapper.frame().area())?,
            journal,
            mapper,
            latest_range: None,
            last_keyframe: None,
            // Of no tick that is open: what is said before the first pose answers nobody.
            progress: Progress::default(),
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        while let Some(pose) = self.pose.take()? {
            let range = self.range_of(pose.stamp.tick)?;
            let changed = self.mapper.step(&pose, range.as_ref());
            self.progress = Progress {
                tick: pose.stamp.tick,
                time: pose.stamp.time(),
            };
            self.journal.append(&Event::Tick { pose, range })?;
            self.send(changed, false)?;
        }
        if let Some(directive) = self.directive.newest()?
            && self.mapper.forget(directive.epoch)
        {
            tracing::warn!(epoch = directive.epoch, "sensed belief reset");
            let epoch = directive.epoch;
            self.journal.append(&Event::Forget { epoch })?;
            self.tell_whole()?;
        }
        if self.grid.has_new_reader() {
            self.tell_whole()?;
        }
        Ok(self.progress)
    }

    /// A belief that is wrong is wrong in its checkpoint, too.
    fn inject(&mut self, fault: FaultKind) -> Result<bool, StageError> {
        self.mapper.inject(fault);
        self.journal.append(&Event::Fault(fault))?;
        Ok(true)
    }

    /// What takes the time of the whole map.
    fn idle(&mut self) -> Result<(), StageError> {
        let due = |last| self.progress.time.since(last) >= KEYFRAME_EVERY;
        if self.last_keyframe.is_none_or(due) {
            self.tell_whole()?;
        }
        if self.journal.is_long() {
            self.journal.snapshot(self.mapper.belief())?;
        }
        Ok(())
    }
}

impl Shell {
    /// The range sample of `tick`; those before it are dropped, one after it is kept for later.
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

    fn tell_whole(&mut self) -> Result<(), StageError> {
        self.last_keyframe = Some(self.progress.time);
        self.send(self.mapper.frame().whole(), true)
    }

    fn send(&mut self, window: Window, keyframe: bool) -> Result<(), StageError> {
        let belief = self.mapper.belief();
        let frame = self.mapper.frame();
        let header = GridHeader {
            part: Revision {
                frame,
                window,
                version: belief.version(),
                keyframe,
            }
            .into(),
            safety_events: belief.safety_events(),
            epoch: belief.epoch(),
            ..GridHeader::default()
        };
        let Progress { tick, time } = self.progress;
        self.grid
            .publish(tick, time, header, frame.cells_of(window, belief.cells()))?;
        Ok(())
    }
}
