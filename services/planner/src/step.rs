//! Pure planner step: it follows `grid`, keeps a field of it and answers a pose with guidance.

mod live;
mod output;

use std::sync::Arc;

use common::{
    clock::MissionTime,
    found_response::FoundResponse,
    geometry::wrap_angle,
    grid::{Applied, GridFrame, Replica, Window},
    kinematics::{LEAST_SPEED_M_S, Pose2, Twist},
    mission::{Lead, Method, Mission},
    samples::{
        CommandSample, CommandState, FaultKind, FieldCell, FieldHeader, GridHeader, GuidanceSample,
        GuidanceStatus, Maneuver, PoseSample, TargetPoint, TargetSample,
    },
    target::Reached,
};
use glam::DVec2;
use harmonic::{Cancellation, Cell, Domain, Screening, Settings, SolveError, Solver};

use crate::active_sensing::ActiveSensing;
use crate::aim;
use crate::arcs::Arcs;
use crate::evasion::Evasion;
use crate::fault::lead_astray;
use crate::motion::{Advice, MotionModel, Moving, STAND};
use crate::outline::Passage;
use crate::view::field_cell;
use live::{Live, is_hazard};

pub use output::{Job, Snapshot, Solved, Work};

/// Speed limit out of a hazard around the robot, m/s, because an obstacle is near.
const WAY_OUT_M_S: f64 = 0.08;

#[allow(clippy::large_enum_variant, reason = "a planner has one")]
#[derive(Debug)]
enum Advisor {
    /// Paper's method, and a robot without arcs or sensing.
    Follow,
    /// Requires that the sonar has looked ahead.
    LookFirst(ActiveSensing),
    /// Requires a drivable arc.
    Steer(Arcs),
}

impl Advisor {
    fn new(mission: &Mission) -> Self {
        match (mission.method, Arcs::new(mission)) {
            (Method::Evidential, Some(arcs)) => Self::Steer(arcs),
            (Method::Evidential, None) if mission.sensing => {
                Self::LookFirst(ActiveSensing::new(mission))
            }
            (Method::Paper | Method::Evidential, _) => Self::Follow,
        }
    }
}

#[derive(Debug)]
pub struct Planner {
    mission: Mission,
    found: FoundResponse,
    /// `None` before the supervisor names one.
    target: Option<TargetSample>,
    advisor: Advisor,
    /// `None` for a robot that cannot detect movers.
    evasion: Option<Evasion>,
    /// `None` for a base without a known acceleration limit.
    motion: Option<MotionModel>,
    /// `None` for a base with a short delay.
    lead: Option<Lead>,
    solver: Solver,
    grid: Replica<u8>,
    belief: GridHeader,
    /// `None` before the first keyframe.
    live: Option<Live>,
    on_a_saddle: bool,
    reached: Reached,
    jobs: u64,
    full_solves: u64,
}

impl Planner {
    /// Creates a planner without a map.
    ///
    /// It persists nothing, because the mapper publishes a keyframe for each new planner.
    pub fn new(mission: &Mission) -> Self {
        Self {
            mission: mission.clone(),
            found: FoundResponse::default(),
            target: None,
            advisor: Advisor::new(mission),
            evasion: Evasion::new(mission),
            motion: MotionModel::of_limited(mission),
            lead: Lead::new(mission),
            solver: Solver::new(Settings::default()),
            grid: Replica::default(),
            belief: GridHeader::default(),
            live: None,
            on_a_saddle: false,
            reached: Reached::default(),
            jobs: 0,
            full_solves: 0,
        }
    }

    /// Follows a sample of `grid` with the cells of its window.
    ///
    /// # Errors
    /// Fails, as the methods below, if there is no field: the target lies outside the map, or the
    /// map is invalid.
    pub fn take_grid(&mut self, header: &GridHeader, cells: &[u8]) -> Result<Work, SolveError> {
        let before = self.grid.version();
        if header.epoch != self.belief.epoch && self.forget_ways() {
            self.live = None;
        }
        let work = match self.grid.apply(&header.part, cells) {
            Applied::Missed => return Ok(Work::Missed),
            Applied::Whole => self.solve_first()?,
            Applied::Window(window) if window.area() == 0 && self.live.is_some() => Work::None,
            Applied::Window(window) => self.follow(window, before)?,
        };
        self.belief = *header;
        Ok(work)
    }

    /// Applies the response that the link found for the base, which limits speeds from now on.
    pub fn take_response(&mut self, found: &FoundResponse) -> Work {
        if let Some(mission) = self.found.changed(found, &self.mission) {
            self.advisor = Advisor::new(&mission);
            self.evasion = Evasion::new(&mission);
            self.motion = MotionModel::of_limited(&mission);
            self.lead = Lead::new(&mission);
        }
        Work::None
    }

    pub const fn foresees(&self) -> bool {
        self.lead.is_some()
    }

    pub fn take_command(&mut self, command: &CommandSample) -> Work {
        let CommandSample { v_m_s: v, omega_rad_s: omega, pose_ns, state, .. } = *command;
        let drives = CommandState::from_byte(state) == CommandState::Driving;
        let twist = Twist { v, omega };
        // Samples may hold any values.
        let twist = if drives && self.can(twist) { twist } else { Twist::default() };
        if let Some(lead) = &mut self.lead {
            lead.command(twist, MissionTime(pose_ns).seconds());
        }
        Work::None
    }

    fn can(&self, Twist { v, omega }: Twist) -> bool {
        let body = self.mission.body();
        let most_rad_s = self.mission.turn_rad_s().max(self.mission.hurry().look_rad_s);
        v.abs() <= body.top_speed_m_s && omega.abs() <= most_rad_s
    }

    /// Sets the target if it is inside the perimeter.
    pub fn take_target(&mut self, target: &TargetSample) -> Result<Work, SolveError> {
        let before = self.target.map(|before| before.target.position());
        let Some(frame) = self.grid.frame() else {
            self.target = Some(*target);
            return Ok(Work::None);
        };
        let place = target.target.position();
        if frame.cell_at(place).is_none_or(|cell| frame.is_rim(cell)) {
            return Ok(Work::None);
        }
        self.target = Some(*target);
        if before == Some(place) {
            return Ok(Work::None);
        }
        self.forget_ways();
        self.evasion.iter_mut().for_each(Evasion::forget_encounter);
        let Some(mut live) = self.live.take() else {
            return self.solve_first();
        };
        live.map = self.map(&frame)?;
        live.target_changed(self.grid.version());
        self.live = Some(live);
        Ok(Work::Stale)
    }

    /// Forgets the plan through narrow places and the refused places; returns whether any were
    /// refused.
    fn forget_ways(&mut self) -> bool {
        if let Advisor::LookFirst(ActiveSensing { outline: Some(outline), .. }) = &mut self.advisor
        {
            outline.forget_plan();
        }
        self.live.as_mut().is_some_and(Live::forget_refused)
    }

    fn solve_first(&mut self) -> Result<Work, SolveError> {
        self.live = None;
        let Some(frame) = self.grid.frame() else {
            return Ok(Work::Missed);
        };
        if self.target.is_none() {
            return Ok(Work::None);
        }
        let map = self.map(&frame)?;
        let field = self.solver.solve(&map, &Cancellation::default())?;
        self.full_solves += 1;
        self.live = Some(Live::new(frame, map, field));
        Ok(Work::Solved)
    }

    fn follow(&mut self, window: Window, before: u64) -> Result<Work, SolveError> {
        let Some(mut live) = self.live.take() else {
            return self.solve_first();
        };
        let mut changed = true;
        if self.aim(&live.frame) == Some(live.map.target()) {
            let changes = live.changes_in(window, self.grid.cells());
            live.map.apply(&changes)?;
            changed = !changes.is_empty();
        } else {
            live.map = self.map(&live.frame)?;
            live.refuse_again()?;
        }
        if changed {
            live.map_changed(before);
        }
        self.live = Some(live);
        Ok(if changed { Work::Stale } else { Work::None })
    }

    /// Ends the tick after its guidance: solves the newest map, or returns a background job.
    pub fn end_tick(&mut self) -> Result<(Work, Option<Job>), SolveError> {
        match self.is_solved_here() {
            true => Ok((self.solve_newest()?, None)),
            false => Ok((Work::None, self.begin_job())),
        }
    }

    fn is_solved_here(&self) -> bool {
        self.live.as_ref().is_some_and(Live::is_solved_here)
    }

    fn solve_newest(&mut self) -> Result<Work, SolveError> {
        let Some(live) = &mut self.live else {
            return Ok(Work::None);
        };
        let field = self.solver.solve_near(&live.map, &live.field, &Cancellation::default())?;
        live.follow(Arc::new(field));
        self.full_solves += 1;
        Ok(Work::Solved)
    }

    /// Builds the domain with a free target cell, because the mapper may not know the target yet.
    fn map(&self, frame: &GridFrame) -> Result<Domain, SolveError> {
        let side = frame.cells as usize;
        let blocked = self.grid.cells().iter().map(|&cell| is_hazard(cell));
        let mut blocked: Vec<_> = blocked.collect();
        // The solver refuses a target outside the map.
        let aim = self.aim(frame).unwrap_or(Cell::new(side, side));
        if let Some(cell) = blocked.get_mut(aim.row * side + aim.col) {
            *cell = false;
        }
        Domain::new(side, side, blocked, aim)?.with_screening(&screening(&self.mission))
    }

    fn place(&self) -> Option<DVec2> {
        self.target.map(|target| target.target.position())
    }

    /// Returns the target's cell, or a free one near it that the robot can enter.
    ///
    /// In the evidential method, the body must also fit there.
    fn aim(&self, frame: &GridFrame) -> Option<Cell> {
        let (cells, target) = (self.grid.cells(), self.place()?);
        let aim = match self.advisor {
            Advisor::Follow => {
                aim::cell_with_a_way_in(frame, cells, target, self.mission.arrival_tolerance_m)
            }
            Advisor::LookFirst(_) | Advisor::Steer(_) => aim::cell(frame, cells, target),
        };
        aim.map(field_cell)
    }

    fn begin_job(&mut self) -> Option<Job> {
        let live = self.live.as_mut()?;
        let job = live.begin_job(self.jobs + 1, self.grid.version())?;
        self.jobs = job.number;
        Some(job)
    }

    /// Takes a job's result unless it is stale.
    pub fn swap_in(&mut self, solved: Solved) -> Result<Work, SolveError> {
        let Some(live) = &mut self.live else {
            return Ok(Work::None);
        };
        if !live.take(solved)? {
            return Ok(Work::None);
        }
        self.full_solves += 1;
        Ok(Work::SwappedIn)
    }

    pub fn corrupt(&mut self, fault: FaultKind, robot: DVec2) -> Work {
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

    /// Returns the guidance for the pose of `sample`.
    ///
    /// A small map is solved first if the field is not valid there.
    pub fn answer(&mut self, sample: &PoseSample) -> Result<(Work, GuidanceSample), SolveError> {
        let (pose, time_s) = (sample.pose(), sample.stamp.seconds());
        let foreseen = self.lead.as_mut().map(|lead| lead.foresee(pose, time_s));
        let (acts_at, twist) = foreseen.unwrap_or((pose, sample.twist()));
        let mut work = Work::None;
        let mut followed = self.follow_field(&acts_at);
        if followed.is_none() && self.is_solved_here() {
            work = self.solve_newest()?;
            followed = self.follow_field(&acts_at);
        }
        let target = self.place().unwrap_or_default();
        Ok((work, self.guide(sample, Moving { pose: acts_at, twist, target }, followed)))
    }

    fn follow_field(&self, pose: &Pose2) -> Option<(GuidanceStatus, DVec2)> {
        let (live, target) = (self.live.as_ref()?, self.place()?);
        live.guide(&self.mission, pose, target, self.grid.cells())
    }

    fn guide(
        &mut self,
        sample: &PoseSample,
        acts_at: Moving,
        followed: Option<(GuidanceStatus, DVec2)>,
    ) -> GuidanceSample {
        let (status, direction) = followed.unwrap_or((GuidanceStatus::Waiting, DVec2::ZERO));
        let Advice { status, maneuver, to, limit } = if self.on_a_saddle {
            Advice::along(DVec2::ZERO, 0.0)
        } else {
            let advice = self.advise(&acts_at.pose, status, direction);
            let advice = match (&self.live, &mut self.evasion) {
                (Some(live), Some(evasion)) if advice.status != GuidanceStatus::AtTarget => {
                    let view = live.view(self.grid.cells());
                    let now = Moving { pose: sample.pose(), twist: sample.twist(), ..acts_at };
                    let at_s = sample.stamp.seconds();
                    evasion.advise(&view, self.belief.movers(), at_s, now, advice)
                }
                _ => advice,
            };
            self.within_motion(acts_at, advice)
        };
        GuidanceSample {
            ex: to.x,
            ey: to.y,
            speed_limit_m_s: limit,
            status: status.into(),
            maneuver: maneuver.into(),
            grid_version: self.grid.version(),
            full_solves: self.full_solves,
            ..GuidanceSample::for_pose(sample, &self.belief, &self.target.unwrap_or_default())
        }
    }

    /// Returns `advice` within the limits of the base: it stands if one more tick rules out a rest
    /// without a touch.
    fn within_motion(&self, acts_at: Moving, advice: Advice) -> Advice {
        let (Some(live), Some(motion), Advisor::LookFirst(sensing)) =
            (&self.live, &self.motion, &self.advisor)
        else {
            return advice;
        };
        let view = live.view(self.grid.cells());
        let touches = |at: &Pose2, doubt_m| match &sensing.outline {
            Some(outline) => outline.comes_near(&view, at, doubt_m),
            None => view.is_hazard(at.position),
        };
        let dead_s = if self.lead.is_some() { 0.0 } else { motion.dead_s() };
        let advice = motion.turns_too(acts_at, dead_s, advice);
        if motion.rests(acts_at, (advice, dead_s), touches) { advice } else { STAND }
    }

    fn advise(&mut self, pose: &Pose2, status: GuidanceStatus, direction: DVec2) -> Advice {
        let free = Advice::new(status, direction, f64::INFINITY);
        let heading = self.heading_there(pose, status);
        let (Some(live), Some(target)) = (&self.live, self.place()) else {
            return free;
        };
        let view = live.view(self.grid.cells());
        if let Some(heading) = heading {
            let turn = wrap_angle(heading - pose.heading);
            return match &self.advisor {
                Advisor::LookFirst(ActiveSensing { outline: Some(outline), .. })
                    if !outline.turns(&view, pose, turn) =>
                {
                    Advice { status: GuidanceStatus::Unreachable, ..STAND }
                }
                _ => Advice {
                    maneuver: Maneuver::Turn,
                    ..Advice::new(status, DVec2::from_angle(heading), 0.0)
                },
            };
        }
        let sensing = match (&mut self.advisor, status) {
            (Advisor::LookFirst(sensing), _) => sensing,
            (Advisor::Steer(arcs), GuidanceStatus::Along | GuidanceStatus::WayOut) => {
                let distance = pose.position.distance(target);
                let (to, limit) = arcs.advise(&view, pose, distance);
                return Advice { to, limit, ..free };
            }
            (Advisor::Follow | Advisor::Steer(_), _) => return free,
        };
        let advice = match status {
            GuidanceStatus::Along => sensing.advise(&view, &self.belief, pose, direction),
            GuidanceStatus::WayOut => {
                let limit = sensing.limit_before_echoes(&self.belief, pose);
                Advice { limit: limit.min(WAY_OUT_M_S), ..free }
            }
            // A false echo may block the way, so the robot looks around once before the map is
            // reset.
            GuidanceStatus::Unreachable => Advice::new(status, pose.axis().perp(), 0.0),
            _ => Advice { limit: 0.0, ..free },
        };
        let Some(outline) = &mut sensing.outline else {
            return advice;
        };
        let axis = pose.axis();
        let may_turn = outline.turns(&view, pose, axis.angle_to(advice.to));
        let slow = match advice.status {
            GuidanceStatus::Along => advice.limit,
            GuidanceStatus::Look if !may_turn => LEAST_SPEED_M_S,
            GuidanceStatus::WayOut if !may_turn => {
                let is_behind = axis.dot(advice.to).is_sign_negative();
                let maneuver = if is_behind { Maneuver::Back } else { Maneuver::Follow };
                return Advice { maneuver, to: axis, ..advice };
            }
            GuidanceStatus::Unreachable if !may_turn => {
                return Advice { to: DVec2::ZERO, ..advice };
            }
            _ => return advice,
        };
        match outline.pass(&view, pose, direction) {
            Passage::Follow(most) => Advice::along(direction, slow.min(most)),
            Passage::Turn(there) => Advice::new(GuidanceStatus::Look, there, 0.0),
            Passage::Drive(there, most) => {
                let limit = sensing.limit_before_echoes(&self.belief, pose);
                Advice::along(there, most.min(limit))
            }
            Passage::Back(limit) => Advice::back(axis, limit),
            Passage::Refused(cells) => {
                let version = self.grid.version();
                if let Some(live) = self.live.as_mut().filter(|_| !cells.is_empty()) {
                    // The cells come from this map, so they lie inside it.
                    let _ = live.refuse(&cells, version);
                }
                Advice::along(axis, 0.0)
            }
        }
    }

    /// Returns the heading to which a robot at its target turns.
    fn heading_there(&mut self, pose: &Pose2, status: GuidanceStatus) -> Option<f64> {
        let TargetSample { number, target, .. } = self.target?;
        let (distance, tolerance) =
            (pose.position.distance(target.position()), self.mission.arrival_tolerance_m);
        let beside = status == GuidanceStatus::AtTarget;
        target.heading().filter(|_| self.reached.is(number, distance, tolerance, beside))
    }

    /// Returns the field to `target` on a map, which a new planner computes.
    pub fn field_to(
        target: DVec2,
        mission: &Mission,
        header: &GridHeader,
        cells: &[u8],
    ) -> Option<Vec<FieldCell>> {
        let mut planner = Self::new(mission);
        let target = TargetPoint::at(target);
        let sent = TargetSample { number: 1, last: 1, target, ..TargetSample::default() };
        planner.take_target(&sent).ok()?;
        planner.take_grid(header, cells).ok()?;
        Some(planner.snapshot()?.cells())
    }

    pub fn snapshot(&self) -> Option<Snapshot> {
        let (live, target) = (self.live.as_ref()?, self.place()?);
        let verification = live.field.verification();
        let header = FieldHeader {
            grid_version: live.field_version(self.grid.version()),
            target_x_m: target.x,
            target_y_m: target.y,
            worst_residual: verification.worst_residual,
            reachable: verification.reachable as u64,
            ..FieldHeader::default()
        };
        Some(Snapshot { header, frame: live.frame, field: Arc::clone(&live.field) })
    }
}

fn screening(mission: &Mission) -> Screening {
    Screening {
        length: mission.screening_length_m().unwrap_or(f64::INFINITY),
        cell: mission.grid_frame().resolution_m,
    }
}

#[cfg(test)]
pub(crate) mod tests;
