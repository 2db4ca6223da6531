//! `pose` and `range` in, `grid` out: a window for each change, a keyframe for each newcomer and now and
//! then, nothing but a stamp otherwise, so that every tick goes on to the planner.

use std::time::Duration;

use common::{
    bus::{Reader, SliceWriter},
    checkpoint::Checkpoint,
    clock::MissionTime,
    grid::{Revision, Window},
    samples::{DirectiveSample, GridHeader, PoseSample, RangeSample},
    shell::{Context, Process, Progress, StageError},
    topics,
};

use crate::step::{Belief, Mapper};

/// Mission time after which the whole map is said again.
const KEYFRAME_EVERY: Duration = Duration::from_secs(1);

/// The mapper process.
#[derive(Debug)]
pub struct Shell {
    pose: Reader<PoseSample>,
    range: Reader<RangeSample>,
    directive: Reader<DirectiveSample>,
    grid: SliceWriter<GridHeader, u8>,
    checkpoint: Checkpoint,
    mapper: Mapper,
    latest_range: Option<RangeSample>,
    last_keyframe: Option<MissionTime>,
    progress: Progress,
}

impl Process for Shell {
    fn open(context: &mut Context) -> Result<Self, StageError> {
        let mut mapper = Mapper::new(&context.run.mission);
        let capacity = mapper.frame().area() + 64;
        let (checkpoint, kept) = Checkpoint::open::<Belief>(&context.checkpoint_file(), capacity)?;
        if let Some(belief) = kept {
            let version = belief.version();
            if mapper.restore(belief) {
                tracing::info!(version, "belief restored");
            } else {
                tracing::warn!("the kept belief is of another map; starting from the perimeter");
            }
        }
        context.waiter.on(context.bus.alarm(&topics::POSE)?);
        context.waiter.on(context.bus.alarm(&topics::DIRECTIVE)?);
        let generation = context.life.generation;
        Ok(Self {
            pose: context.bus.reader(&topics::POSE)?,
            range: context.bus.reader(&topics::RANGE)?,
            directive: context.bus.reader(&topics::DIRECTIVE)?,
            grid: context
                .bus
                .slice_writer(&topics::GRID, generation, mapper.frame().area())?,
            checkpoint,
            mapper,
            latest_range: None,
            last_keyframe: None,
            // Of no tick that is open: what is said before the first pose answers nobody.
            progress: Progress::default(),
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        let mut told = false;
        while let Some(pose) = self.pose.take()? {
            let range = self.range_of(pose.stamp.tick)?;
            let changed = self.mapper.step(&pose, range.as_ref());
            self.progress = Progress {
                tick: pose.stamp.tick,
                time: pose.stamp.time(),
            };
            if changed.area() > 0 {
                self.checkpoint.save(self.mapper.belief())?;
            }
            self.publish(changed)?;
            told = true;
        }
        if let Some(directive) = self.directive.newest()?
            && self.mapper.forget(directive.epoch)
        {
            tracing::warn!(epoch = directive.epoch, "sensed belief reset");
            self.checkpoint.save(self.mapper.belief())?;
            self.publish_keyframe()?;
        } else if !told && self.grid.has_new_reader() {
            self.publish_keyframe()?;
        }
        Ok(self.progress)
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

    fn publish(&mut self, changed: Window) -> Result<(), StageError> {
        let due = self
            .last_keyframe
            .is_none_or(|last| self.progress.time.since(last) >= KEYFRAME_EVERY);
        if due || self.grid.has_new_reader() {
            return self.publish_keyframe();
        }
        self.send(changed, false)
    }

    fn publish_keyframe(&mut self) -> Result<(), StageError> {
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
