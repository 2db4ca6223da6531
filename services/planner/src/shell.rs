//! `grid` and `pose` in; `guidance` each tick, `field` at every change and now and then.

use std::time::Instant;

use common::{
    bus::{Reader, SliceReader, SliceWriter, Writer},
    clock::{MissionClock, MissionTime},
    grid::Revision,
    samples::{FaultKind, FieldCell, FieldHeader, GridHeader, GuidanceSample, PoseSample},
    shell::{Context, Process, Progress, StageError},
    topics::{self, AnyTopic as _},
};

use harmonic::SolveError;

use crate::{
    beside::{BesideSolver, Solved},
    step::{Planner, Work},
};

/// On a clock of ticks the result of a full solve beside the live field is swapped in so many ticks after
/// it began, sooner never and later never, so that a run can be repeated. At 7 Hz the largest map is solved
/// by then on a wall clock, too.
const SWAP_AFTER_TICKS: u64 = 2;

/// The planner process.
#[derive(Debug)]
pub struct Shell {
    grid: SliceReader<GridHeader, u8>,
    pose: Reader<PoseSample>,
    guidance: Writer<GuidanceSample>,
    field: SliceWriter<FieldHeader, FieldCell>,
    planner: Planner,
    beside: BesideSolver,
    /// On a clock of ticks, the tick at which the job that runs is swapped in.
    swap_at: Option<u64>,
    in_ticks: bool,
    latest_pose: Option<PoseSample>,
    /// The tick last answered.
    answered: Option<u64>,
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
        let generation = context.generation.number;
        let mission = &context.run.mission;
        let longest = mission.grid_frame().area();
        context.waiter.on(context.bus.wakeup(&topics::GRID)?);
        let beside = BesideSolver::start().map_err(|error| {
            StageError::Other(format!("cannot start the thread of full solves: {error}"))
        })?;
        context.waiter.on_readable(&beside)?;
        Ok(Self {
            grid: context.bus.slice_reader(&topics::GRID)?,
            pose: context.bus.reader(&topics::POSE)?,
            guidance: context.bus.writer(&topics::GUIDANCE, generation)?,
            field: context
                .bus
                .slice_writer(&topics::FIELD, generation, longest)?,
            planner: Planner::new(mission),
            beside,
            swap_at: None,
            in_ticks: matches!(context.run.clock, MissionClock::Ticks { .. }),
            latest_pose: None,
            answered: None,
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
        let asked = self.follow_grid()?;
        let swapped = self.swap_in_what_is_due()?;
        if asked || swapped && !self.in_ticks {
            self.answer()?;
        }
        Ok(self.progress)
    }

    fn inject(&mut self, fault: FaultKind) -> Result<bool, StageError> {
        let robot = self.latest_pose.unwrap_or_default().pose();
        let broken = self.planner.inject(fault, robot.position);
        self.field_changed |= broken;
        Ok(broken)
    }

    fn idle(&mut self) -> Result<(), StageError> {
        self.begin_beside();
        self.tell_field()
    }
}

#[allow(clippy::needless_pass_by_value, reason = "the shape map_err wants")]
fn no_field(error: SolveError) -> StageError {
    StageError::Other(format!("no field: {error}"))
}

impl Shell {
    /// Swap in the full solves that ran beside the live field. Says whether there was one.
    fn swap_in_what_is_due(&mut self) -> Result<bool, StageError> {
        let tick = self.progress.tick;
        let mut swapped = false;
        if self.planner.beside().is_none() {
            self.swap_at = None;
        }
        if !self.in_ticks {
            while let Some(solved) = self.beside.take() {
                swapped |= self.swap_in(solved)?;
            }
        } else if self.swap_at.is_some_and(|at| tick >= at) {
            self.swap_at = None;
            let number = self.planner.beside();
            while let Some(solved) = self.beside.wait() {
                let awaited = Some(solved.number) == number;
                swapped |= self.swap_in(solved)?;
                if awaited {
                    break;
                }
            }
        }
        Ok(swapped)
    }

    /// Begin the full solve that is called for, if one is.
    fn begin_beside(&mut self) {
        let Some(job) = self.planner.begin_beside() else {
            return;
        };
        tracing::debug!(
            number = job.number,
            urgent = job.urgent,
            "full solve begins"
        );
        // A robot that waits for it waits no longer than it must.
        let after = if job.urgent { 1 } else { SWAP_AFTER_TICKS };
        self.swap_at = Some(self.progress.tick + after);
        self.beside.begin(job);
    }

    fn swap_in(&mut self, solved: Solved) -> Result<bool, StageError> {
        let Solved {
            number,
            result,
            took_ns,
        } = solved;
        match result {
            Ok((domain, field)) => {
                let swapped = self
                    .planner
                    .swap_in(number, domain, field)
                    .map_err(no_field)?;
                if swapped {
                    self.field_changed = true;
                    self.full_solve_ns = took_ns;
                }
                Ok(swapped)
            }
            Err(SolveError::Cancelled) => Ok(false),
            Err(error) => Err(no_field(error)),
        }
    }

    /// Follow every grid sample that came. Says whether an answer is due.
    fn follow_grid(&mut self) -> Result<bool, StageError> {
        let mut asked = false;
        while let Some(grid) = self.grid.take()? {
            let began = Instant::now();
            let work = self
                .planner
                .take_grid(grid.header(), &grid)
                .map_err(no_field)?;
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
            let GridHeader { stamp, part, .. } = *grid.header();
            // The whole map, told again behind the tick it belongs to, asks for nothing; a tick that is
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
        // A grid for newcomers may be of a tick that is over.
        let tick = self.progress.tick;
        let Some(pose) = self.latest_pose.filter(|pose| pose.stamp.tick == tick) else {
            return Ok(());
        };
        let guidance = GuidanceSample {
            pose_ns: pose.stamp.stamp_ns,
            full_solve_ns: self.full_solve_ns,
            local_update_ns: self.local_update_ns,
            ..self.planner.guide(&pose.pose())
        };
        let Progress { tick, time } = self.progress;
        self.guidance.publish(tick, time, guidance)?;
        self.answered = Some(tick);
        Ok(())
    }

    /// The field for consumers, after the robot has its guidance: what changed, or all of it when it was
    /// not told for long or somebody new listens.
    fn tell_field(&mut self) -> Result<(), StageError> {
        let since = |told: Option<MissionTime>| told.map(|told| self.progress.time.since(told));
        let keyframe = self.field.has_new_reader()
            || since(self.keyframe_told).is_none_or(|age| age >= topics::FIELD.restated_every());
        let change = self.field_changed
            && since(self.change_told)
                .is_none_or(|age| age >= topics::FIELD.changes_at_most_every());
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
