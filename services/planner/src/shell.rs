//! `grid` and `pose` in; `guidance` each tick, `field` at every change and now and then.

use std::time::{Duration, Instant};

use common::{
    bus::{Reader, SliceReader, SliceWriter, Writer},
    clock::MissionTime,
    grid::Revision,
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
    /// The policy that consumers hold.
    told: Vec<FieldCell>,
    change_told: Option<MissionTime>,
    keyframe_told: Option<MissionTime>,
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
            told: Vec::new(),
            change_told: None,
            keyframe_told: None,
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

    /// The field for consumers, after the robot has its guidance: what changed, or all of it when it was
    /// not told for long or somebody new listens.
    fn tell_field(&mut self) -> Result<(), StageError> {
        let since = |told: Option<MissionTime>| told.map(|told| self.progress.time.since(told));
        let keyframe = self.field.has_new_reader()
            || since(self.keyframe_told).is_none_or(|age| age >= topics::FIELD.restated_every());
        let change = self.field_changed
            && since(self.change_told).is_none_or(|age| age >= FIELD_AT_MOST_EVERY);
        if !(keyframe || change) {
            return Ok(());
        }
        let Some((header, frame, cells)) = self.planner.policy() else {
            return Ok(());
        };
        self.field_changed = false;
        self.change_told = Some(self.progress.time);
        let comparable = self.told.len() == cells.len();
        let changed = if comparable {
            frame.changed_window(&self.told, &cells)
        } else {
            frame.whole()
        };
        let keyframe = keyframe || changed == frame.whole();
        if changed.area() > 0 {
            self.field_version += 1;
        } else if !keyframe {
            return Ok(());
        }
        let window = if keyframe { frame.whole() } else { changed };
        if keyframe {
            self.keyframe_told = Some(self.progress.time);
        }
        let header = FieldHeader {
            part: Revision {
                frame,
                window,
                version: self.field_version,
                keyframe,
            }
            .into(),
            ..header
        };
        let Progress { tick, time } = self.progress;
        let part = frame.cells_of(window, &cells);
        self.field.publish(tick, time, header, part)?;
        self.told = cells;
        Ok(())
    }
}
