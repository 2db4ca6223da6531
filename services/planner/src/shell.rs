//! `grid` and `pose` in; `guidance` each tick, `field` at every change and now and then.

use std::time::{Duration, Instant};

use common::{
    bus::{Reader, SliceReader, SliceWriter, Writer},
    clock::MissionTime,
    samples::{FieldCell, FieldHeader, GridHeader, GuidanceSample, PoseSample},
    shell::{Context, Process, Progress, StageError},
    topics::{self, AnyTopic as _},
};

use crate::step::{Planner, Work};

/// Changes of the field are told at most so often in mission time: it is for eyes and loggers, and the
/// robot should not wait for it.
const FIELD_AT_MOST_EVERY: Duration = Duration::from_millis(250);

/// The planner process.
#[derive(Debug)]
pub struct Shell {
    grid: SliceReader<GridHeader, u8>,
    pose: Reader<PoseSample>,
    guidance: Writer<GuidanceSample>,
    field: SliceWriter<FieldHeader, FieldCell>,
    planner: Planner,
    latest_pose: Option<PoseSample>,
    full_solve_ns: u64,
    local_update_ns: u64,
    field_version: u64,
    field_changed: bool,
    field_told: Option<MissionTime>,
    progress: Progress,
}

impl Process for Shell {
    fn open(context: &mut Context) -> Result<Self, StageError> {
        let generation = context.life.generation;
        let mission = &context.run.mission;
        let longest = mission.grid_frame().area();
        context.waiter.on(context.bus.alarm(&topics::GRID)?);
        Ok(Self {
            grid: context.bus.slice_reader(&topics::GRID)?,
            pose: context.bus.reader(&topics::POSE)?,
            guidance: context.bus.writer(&topics::GUIDANCE, generation)?,
            field: context
                .bus
                .slice_writer(&topics::FIELD, generation, longest)?,
            planner: Planner::new(mission),
            latest_pose: None,
            full_solve_ns: 0,
            local_update_ns: 0,
            field_version: 0,
            field_changed: false,
            field_told: None,
            progress: Progress::default(),
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        if let Some(grid) = self.follow_grid()? {
            self.progress = Progress {
                tick: grid.stamp.tick,
                time: grid.stamp.time(),
            };
            self.answer()?;
        }
        self.tell_field()?;
        Ok(self.progress)
    }
}

impl Shell {
    /// Follow every grid sample that came; the header of the newest that was followed.
    fn follow_grid(&mut self) -> Result<Option<GridHeader>, StageError> {
        let mut newest = None;
        while let Some(grid) = self.grid.take()? {
            let began = Instant::now();
            let work = self
                .planner
                .take_grid(grid.header(), &grid)
                .map_err(|error| StageError::Other(format!("no field: {error}")))?;
            let took = began.elapsed().as_nanos() as u64;
            match work {
                Work::Missed => {
                    tracing::warn!(
                        version = grid.header().part.version,
                        "missed a grid version"
                    );
                    continue;
                }
                Work::None => {}
                Work::FullSolve => {
                    self.full_solve_ns = took;
                    self.field_changed = true;
                    tracing::info!(took_us = took / 1000, "full solve");
                }
                Work::LocalUpdate => {
                    self.local_update_ns = took;
                    self.field_changed = true;
                }
            }
            newest = Some(*grid.header());
        }
        Ok(newest)
    }

    /// Guidance for the pose of the tick, which was published before the grid was.
    fn answer(&mut self) -> Result<(), StageError> {
        if let Some(pose) = self.pose.newest()? {
            self.latest_pose = Some(pose);
        }
        let Some(pose) = self.latest_pose else {
            return Ok(());
        };
        let guidance = GuidanceSample {
            full_solve_ns: self.full_solve_ns,
            local_update_ns: self.local_update_ns,
            ..self.planner.guide(&pose.pose())
        };
        let Progress { tick, time } = self.progress;
        self.guidance.publish(tick, time, guidance)?;
        Ok(())
    }

    /// The field for consumers, after the robot has its guidance.
    fn tell_field(&mut self) -> Result<(), StageError> {
        let at_least_every = topics::FIELD.restated_every();
        let age = self.field_told.map(|told| self.progress.time.since(told));
        let due = age.is_none_or(|age| {
            age >= at_least_every || self.field_changed && age >= FIELD_AT_MOST_EVERY
        });
        if !(due || self.field.has_new_reader()) {
            return Ok(());
        }
        if self.field_changed {
            self.field_version += 1;
        }
        if let Some((header, cells)) = self.planner.policy(self.field_version) {
            self.field_told = Some(self.progress.time);
            self.field_changed = false;
            let Progress { tick, time } = self.progress;
            self.field.publish(tick, time, header, cells.into_iter())?;
        }
        Ok(())
    }
}
