//! The stage, pure: follow the `grid`, keep the field right, answer for a pose.

mod input;
mod live;
mod snapshot;

use std::sync::Arc;

use common::{
    clock::MissionTime,
    grid::{self, Applied, GridFrame, Replica, Window},
    kinematics::Pose2,
    mission::{Method, Mission},
    samples::{FaultKind, FieldHeader, GridHeader, GuidanceSample, GuidanceStatus, PoseSample},
    step::{ForeignState, Step},
};
use glam::DVec2;
use harmonic::{
    Cancellation, Cell, Change, Domain, Guidance, Screening, Settings, SolveError, Solver, Verdict,
};

use crate::active_sensing::{ActiveSensing, Advice, View};
use crate::aim;
use crate::arcs::Arcs;
use crate::fault::lead_astray;
use live::{Live, changes_in, field_cell, is_hazard};

pub use input::{Input, Job, Outcome, Solved, Work};
pub use snapshot::Snapshot;

/// Maps of at most this many cells (1024 a side) are solved whole at once where the robot has no direction to trust after a
/// local update: that takes some ten milliseconds, and a run is the same each time. On larger ones it waits for the
/// background solver.
const AT_ONCE: usize = 1 << 20;

/// How fast the evidential method leaves a hazard the robot stands in, m/s: something is near.
const WAY_OUT_M_S: f64 = 0.08;

/// What a direction of the field is checked for before it is given.
#[derive(Clone, Copy, Debug)]
enum Advisor {
    /// The paper's method, and any without sensing: nothing, the robot goes where the field points.
    Follow,
    /// The evidential method: whether the sonar looked there.
    LookFirst(ActiveSensing),
    /// The same of a car, which cannot look around on the spot: what it can steer.
    Steer(Arcs),
}

/// The planner of (11).
#[derive(Debug)]
pub struct Planner {
    target: DVec2,
    tolerance_m: f64,
    screening: Screening,
    advisor: Advisor,
    solver: Solver,
    grid: Replica<u8>,
    belief: GridHeader,
    live: Option<Live>,
    /// A full solve is called for: the field was updated in a window.
    solve_advised: bool,
    /// Until then the field is not to be followed: a passage closed or opened.
    unsafe_until_solved: bool,
    /// The robot waits for a full solve.
    urgent: bool,
    /// Broken on purpose: no direction is given, wherever the robot is.
    on_a_saddle: bool,
    running: Option<Running>,
    jobs: u64,
    full_solves: u64,
    local_updates: u64,
}

/// The job that the background solver runs.
#[derive(Debug)]
struct Running {
    number: u64,
    urgent: bool,
    /// What changed since its map was taken.
    since: Vec<Change>,
}

impl Step for Planner {
    type Input<'a> = Input<'a>;
    type Output = Result<Outcome, SolveError>;
    /// None: the mapper publishes a keyframe for each new planner.
    type State = ();

    /// It knows nothing until the first keyframe.
    fn new(mission: &Mission) -> Self {
        Self {
            target: mission.target,
            tolerance_m: mission.arrival_tolerance_m,
            screening: screening(mission),
            advisor: match (mission.method, Arcs::new(mission)) {
                (Method::Evidential, Some(arcs)) => Advisor::Steer(arcs),
                (Method::Evidential, None) if mission.sensing => {
                    Advisor::LookFirst(ActiveSensing::new(mission))
                }
                (Method::Paper | Method::Evidential, _) => Advisor::Follow,
            },
            solver: Solver::new(Settings::default()),
            grid: Replica::default(),
            belief: GridHeader::default(),
            live: None,
            solve_advised: false,
            unsafe_until_solved: false,
            urgent: false,
            on_a_saddle: false,
            running: None,
            jobs: 0,
            full_solves: 0,
            local_updates: 0,
        }
    }

    fn state(&self) -> &() {
        &()
    }

    fn restore(&mut self, (): ()) -> Result<(), ForeignState> {
        Ok(())
    }

    /// # Errors
    /// When there is no field: the target's cell is hazard, or the map is no map.
    fn step(&mut self, input: Input<'_>, _: MissionTime) -> Result<Outcome, SolveError> {
        Ok(match input {
            Input::Grid { header, cells } => self.take_grid(header, cells)?.into(),
            Input::Pose(pose) => {
                self.solve_for(pose)?;
                Outcome {
                    guidance: Some(self.guide(pose)),
                    ..Outcome::default()
                }
            }
            Input::Idle => Outcome {
                job: self.begin_job(),
                ..Outcome::default()
            },
            Input::Solved(solved) => self.swap_in(solved)?.into(),
            Input::Fault { fault, robot } => self.corrupt(fault, robot).into(),
        })
    }
}

impl Planner {
    /// Follow one grid sample.
    fn take_grid(&mut self, header: &GridHeader, cells: &[u8]) -> Result<Work, SolveError> {
        let work = match self.grid.apply(&header.part, cells) {
            Applied::Missed => Work::Missed,
            Applied::Whole => self.solve()?,
            Applied::Window(window) if window.area() == 0 && self.live.is_some() => Work::None,
            Applied::Window(window) => self.update(window)?,
        };
        if work != Work::Missed {
            self.belief = *header;
        }
        Ok(work)
    }

    fn solve(&mut self) -> Result<Work, SolveError> {
        self.live = None;
        self.running = None;
        self.solve_advised = false;
        self.unsafe_until_solved = false;
        let Some(frame) = self.grid.frame() else {
            return Ok(Work::Missed);
        };
        let side = frame.cells as usize;
        let blocked = self.grid.cells().iter().map(|&cell| is_hazard(cell));
        // The solver refuses a target outside the map.
        let target = self.aim(&frame);
        let target = target.map_or(Cell::new(side, side), field_cell);
        let domain =
            Domain::new(side, side, blocked.collect(), target)?.with_screening(&self.screening)?;
        let field = self.solver.solve(&domain, &Cancellation::default())?;
        self.full_solves += 1;
        self.live = Some(Live {
            frame,
            domain,
            field: Arc::new(field),
        });
        Ok(Work::FullSolve)
    }

    /// The cell that the field is to lead to: the target's, or a free one near it where that one cannot be entered or, by the
    /// evidential method, the body does not fit.
    fn aim(&self, frame: &GridFrame) -> Option<grid::Cell> {
        match self.advisor {
            Advisor::Follow => {
                aim::cell_with_a_way_in(frame, self.grid.cells(), self.target, self.tolerance_m)
            }
            Advisor::LookFirst(_) | Advisor::Steer(_) => {
                aim::cell(frame, self.grid.cells(), self.target)
            }
        }
    }

    fn update(&mut self, window: Window) -> Result<Work, SolveError> {
        let same_aim = |live: &Live| {
            let aim = self.aim(&live.frame);
            aim.map(field_cell) == Some(live.domain.target())
        };
        if !self.live.as_ref().is_some_and(same_aim) {
            return self.solve();
        }
        let Some(live) = &mut self.live else {
            return self.solve();
        };
        let changes = changes_in(&live.domain, &live.frame, window, self.grid.cells());
        if changes.is_empty() {
            return Ok(Work::None);
        }
        if let Some(running) = &mut self.running {
            running.since.extend_from_slice(&changes);
        }
        let verdict = self.solver.update(
            &mut live.domain,
            Arc::make_mut(&mut live.field),
            &changes,
            &Cancellation::default(),
        )?;
        if verdict == Verdict::Solved {
            self.solved();
            return Ok(Work::FullSolve);
        }
        self.local_updates += 1;
        self.heed(verdict);
        Ok(Work::LocalUpdate)
    }

    /// Every update in a window is followed by a full solve.
    fn heed(&mut self, verdict: Verdict) {
        self.solve_advised |= verdict != Verdict::Solved;
        self.unsafe_until_solved |= verdict == Verdict::PassageClosed;
    }

    /// The live field was solved whole: what was called for is done, and what still runs is stale.
    fn solved(&mut self) {
        self.full_solves += 1;
        self.solve_advised = false;
        self.unsafe_until_solved = false;
        self.running = None;
    }

    /// Solve the map whole, where it is small enough, if a robot at `pose` has no direction to trust.
    fn solve_for(&mut self, pose: &PoseSample) -> Result<(), SolveError> {
        let Some(live) = &mut self.live else {
            return Ok(());
        };
        let waits = self.unsafe_until_solved || !live.is_trusted(pose.pose().position);
        self.urgent = waits;
        if waits && live.frame.area() <= AT_ONCE {
            let before = &live.field;
            let field = self
                .solver
                .solve_near(&live.domain, before, &Cancellation::default())?;
            live.field = Arc::new(field);
            self.urgent = false;
            self.solved();
        }
        Ok(())
    }

    /// The full solve for the background solver, if one is called for. One runs at a time and is
    /// left to finish, or a robot that senses in every tick would never see one finish; only a passage
    /// that closed makes the newest map win at once: then the job before is stale, its result unwanted.
    fn begin_job(&mut self) -> Option<Job> {
        let busy = self
            .running
            .as_ref()
            .is_some_and(|running| running.urgent || !self.unsafe_until_solved);
        if !self.solve_advised || busy {
            return None;
        }
        let domain = self.live.as_ref()?.domain.clone();
        self.solve_advised = false;
        self.jobs += 1;
        let (number, urgent) = (self.jobs, self.unsafe_until_solved || self.urgent);
        self.running = Some(Running {
            number,
            urgent,
            since: Vec::new(),
        });
        Some(Job {
            number,
            urgent,
            domain,
        })
    }

    /// The job whose result is waited for, if any.
    #[must_use]
    pub fn running_job(&self) -> Option<u64> {
        self.running.as_ref().map(|running| running.number)
    }

    /// Swap in what a job gave, brought up to date with what changed meanwhile; the result of a stale job changes
    /// nothing. When it cannot be brought up to date the live field stays.
    fn swap_in(&mut self, solved: Solved) -> Result<Work, SolveError> {
        let (mut domain, mut field) = match solved.result {
            Ok(solved) => *solved,
            Err(SolveError::Cancelled) => return Ok(Work::None),
            Err(error) => return Err(error),
        };
        let number = solved.number;
        let Some(running) = self.running.take_if(|running| running.number == number) else {
            return Ok(Work::None);
        };
        self.unsafe_until_solved = false;
        if !running.since.is_empty() {
            let verdict = self.solver.update(
                &mut domain,
                &mut field,
                &running.since,
                &Cancellation::default(),
            )?;
            self.heed(verdict);
        }
        if let Some(live) = &mut self.live {
            live.domain = domain;
            live.field = Arc::new(field);
            self.full_solves += 1;
        }
        Ok(Work::SwappedIn)
    }

    /// Break the field, if the fault is the planner's and there is a field.
    fn corrupt(&mut self, fault: FaultKind, robot: DVec2) -> Work {
        match (fault, &mut self.live) {
            (FaultKind::CorruptField, Some(live)) => {
                let at = live.frame.to_cells(robot);
                lead_astray(Arc::make_mut(&mut live.field), [at.x, at.y]);
                Work::Broken
            }
            (FaultKind::Saddle, _) => {
                self.on_a_saddle = true;
                Work::Broken
            }
            _ => Work::None,
        }
    }

    /// The reference direction for the robot of that pose.
    fn guide(&self, sample: &PoseSample) -> GuidanceSample {
        let pose = sample.pose();
        let to_target = self.target - pose.position;
        let (status, direction) = match &self.live {
            None => (GuidanceStatus::Waiting, DVec2::ZERO),
            Some(_) if self.unsafe_until_solved => (GuidanceStatus::Waiting, DVec2::ZERO),
            Some(live) => {
                let at = live.frame.to_cells(pose.position);
                match live.field.guidance(at.x, at.y) {
                    _ if live.is_beside_the_target(self.target, pose.position) => {
                        (GuidanceStatus::AtTarget, pose.axis())
                    }
                    Guidance::Along(_) if !live.is_trusted(pose.position) => {
                        (GuidanceStatus::Waiting, DVec2::ZERO)
                    }
                    Guidance::Along(direction) => (GuidanceStatus::Along, direction.into()),
                    Guidance::WayOut(direction) => (GuidanceStatus::WayOut, direction.into()),
                    // Within the target's cell the field has said all it knows; the rest is straight.
                    Guidance::AtTarget => (GuidanceStatus::Along, to_target.normalize_or(DVec2::X)),
                    Guidance::Unreachable => (GuidanceStatus::Unreachable, DVec2::ZERO),
                }
            }
        };
        let (status, direction, limit) = if self.on_a_saddle {
            (GuidanceStatus::Along, DVec2::ZERO, 0.0)
        } else {
            self.advise(&pose, status, direction)
        };
        GuidanceSample {
            ex: direction.x,
            ey: direction.y,
            distance_m: to_target.length(),
            speed_limit_m_s: limit,
            status: status.into(),
            grid_version: self.grid.version(),
            full_solves: self.full_solves,
            local_updates: self.local_updates,
            ..GuidanceSample::for_pose(sample, &self.belief)
        }
    }

    /// Status, direction and speed limit to give where the field says `status` and `direction`.
    fn advise(
        &self,
        pose: &Pose2,
        status: GuidanceStatus,
        direction: DVec2,
    ) -> (GuidanceStatus, DVec2, f64) {
        let Some(live) = &self.live else {
            return (status, direction, f64::INFINITY);
        };
        let view = View {
            frame: live.frame,
            cells: self.grid.cells(),
            field: &live.field,
        };
        let sensing = match (&self.advisor, status) {
            (Advisor::LookFirst(sensing), _) => sensing,
            (Advisor::Steer(arcs), GuidanceStatus::Along | GuidanceStatus::WayOut) => {
                let distance = pose.position.distance(self.target);
                let (direction, limit) = arcs.advise(&view, pose, distance);
                return (status, direction, limit);
            }
            (Advisor::Follow | Advisor::Steer(_), _) => return (status, direction, f64::INFINITY),
        };
        match status {
            GuidanceStatus::Along => match sensing.advise(&view, &self.belief, pose, direction) {
                Advice::Look(there) => (GuidanceStatus::Look, there, 0.0),
                Advice::Go(limit) => (status, direction, limit),
            },
            GuidanceStatus::WayOut => {
                let limit = sensing.limit_before_echoes(&self.belief, pose);
                (status, direction, limit.min(WAY_OUT_M_S))
            }
            // It may be an echo that was none: one look around before the belief is blamed.
            GuidanceStatus::Unreachable => (status, pose.axis().perp(), 0.0),
            _ => (status, direction, 0.0),
        }
    }

    /// The field as it is now; none before the first solve.
    #[must_use]
    pub fn snapshot(&self) -> Option<Snapshot> {
        let Live { frame, field, .. } = self.live.as_ref()?;
        let verification = field.verification();
        let header = FieldHeader {
            grid_version: self.grid.version(),
            target_x_m: self.target.x,
            target_y_m: self.target.y,
            worst_residual: verification.worst_residual,
            reachable: verification.reachable as u64,
            ..FieldHeader::default()
        };
        Some(Snapshot {
            header,
            frame: *frame,
            field: Arc::clone(field),
        })
    }
}

/// The mission's screening length, in the unit of its grid.
fn screening(mission: &Mission) -> Screening {
    mission
        .screening_length_m()
        .map_or(Screening::None, |length| Screening::Uniform {
            length,
            cell: mission.grid_frame().resolution_m,
        })
}

#[cfg(test)]
mod tests;
