//! The stage, pure: follow the `grid`, keep the field right, answer for a pose.

use common::{
    grid::{Applied, CellState, GridFrame, Replica, Window},
    kinematics::Pose2,
    mission::{Method, Mission},
    samples::{FaultKind, FieldCell, FieldHeader, GridHeader, GuidanceSample, GuidanceStatus},
};
use glam::DVec2;

use crate::{
    Absorption, Cancellation, Cell, Change, Domain, Field, Guidance, Settings, SolveError, Solver,
    Verdict,
    lookout::{Advice, Lookout, View},
};

/// Maps of at most this many cells are solved in full at once where a repair does not do: that takes less
/// than a thread takes to begin.
const SMALL: usize = 1 << 14;

/// How fast a careful robot leaves a hazard it stands in, m/s: something is near.
const WAY_OUT_M_S: f64 = 0.08;

/// What taking a grid sample led to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// Nothing changed.
    None,
    /// The field was computed anew.
    FullSolve,
    /// The field was brought up to date around what changed.
    LocalUpdate,
    /// A version is missing: the field is as it was until a keyframe comes.
    Missed,
}

/// The planner of (11).
#[derive(Debug)]
pub struct Planner {
    target: DVec2,
    absorption: f64,
    /// None in the paper's method.
    lookout: Option<Lookout>,
    solver: Solver,
    grid: Replica<u8>,
    belief: GridHeader,
    solved: Option<Solved>,
    /// A full solve would do the field good.
    advised: bool,
    /// Until then the field is not to be followed: a passage closed or opened.
    unsafe_until_solved: bool,
    /// Broken on purpose: no direction is given, wherever the robot is.
    on_a_saddle: bool,
    beside: Option<Beside>,
    jobs: u64,
    full_solves: u64,
    local_updates: u64,
}

/// A field and the domain it is of.
#[derive(Debug)]
struct Solved {
    frame: GridFrame,
    domain: Domain,
    field: Field,
}

/// The full solve that runs beside the live field.
#[derive(Debug)]
struct Beside {
    number: u64,
    urgent: bool,
    /// What changed since its map was taken.
    since: Vec<Change>,
}

/// A full solve to run beside the live field.
#[derive(Debug)]
pub struct Job {
    /// Names it.
    pub number: u64,
    /// Whether the live field waits for it.
    pub urgent: bool,
    /// The map to solve.
    pub domain: Domain,
}

impl Planner {
    /// For a mission; it knows nothing until the first keyframe.
    #[must_use]
    pub fn new(mission: &Mission) -> Self {
        Self {
            target: mission.target,
            absorption: mission.absorption(),
            lookout: (mission.method == Method::Careful).then(|| Lookout::new(mission)),
            solver: Solver::new(Settings::default()),
            grid: Replica::default(),
            belief: GridHeader::default(),
            solved: None,
            advised: false,
            unsafe_until_solved: false,
            on_a_saddle: false,
            beside: None,
            jobs: 0,
            full_solves: 0,
            local_updates: 0,
        }
    }

    /// Follow one grid sample.
    ///
    /// # Errors
    /// When the field cannot be solved: the target's cell is hazard, or the map is no map.
    pub fn take_grid(&mut self, header: &GridHeader, cells: &[u8]) -> Result<Work, SolveError> {
        let work = match self.grid.apply(&header.part.revision(), cells) {
            Applied::Missed => Work::Missed,
            Applied::Whole => self.solve()?,
            Applied::Window(window) if window.area() == 0 && self.solved.is_some() => Work::None,
            Applied::Window(window) => self.update(window)?,
        };
        if work != Work::Missed {
            self.belief = *header;
        }
        Ok(work)
    }

    fn solve(&mut self) -> Result<Work, SolveError> {
        self.solved = None;
        self.beside = None;
        self.advised = false;
        self.unsafe_until_solved = false;
        let Some(frame) = self.grid.frame() else {
            return Ok(Work::Missed);
        };
        let side = frame.cells as usize;
        let blocked = self.grid.cells().iter().map(|&cell| is_hazard(cell));
        let target = frame.to_cells(self.target).round().as_u64vec2();
        let target = Cell::new(target.x as usize, target.y as usize);
        let domain = Domain::new(side, side, blocked.collect(), target)?
            .with_absorption(Absorption::Uniform(self.absorption))?;
        let field = self.solver.solve(&domain, &Cancellation::default())?;
        self.full_solves += 1;
        self.solved = Some(Solved {
            frame,
            domain,
            field,
        });
        Ok(Work::FullSolve)
    }

    fn update(&mut self, window: Window) -> Result<Work, SolveError> {
        let Some(solved) = &mut self.solved else {
            return self.solve();
        };
        let changes = changes_in(&solved.domain, &solved.frame, window, self.grid.cells());
        if changes.is_empty() {
            return Ok(Work::None);
        }
        if let Some(beside) = &mut self.beside {
            beside.since.extend_from_slice(&changes);
        }
        let verdict = self.solver.update(
            &mut solved.domain,
            &mut solved.field,
            &changes,
            &Cancellation::default(),
        )?;
        if verdict != Verdict::Repaired && solved.frame.area() <= SMALL {
            solved.field = self
                .solver
                .solve(&solved.domain, &Cancellation::default())?;
            self.full_solves += 1;
            return Ok(Work::FullSolve);
        }
        self.local_updates += 1;
        self.heed(verdict);
        Ok(Work::LocalUpdate)
    }

    fn heed(&mut self, verdict: Verdict) {
        self.advised |= verdict != Verdict::Repaired;
        self.unsafe_until_solved |= verdict == Verdict::PassageClosed;
    }

    /// The full solve to begin beside the live field, if one is called for. One runs at a time and is
    /// left to finish, or a robot that senses in every tick would never see one finish; only a passage
    /// that closed makes the newest map win at once: then the job before is stale, its result unwanted.
    pub fn begin_beside(&mut self) -> Option<Job> {
        let busy = self
            .beside
            .as_ref()
            .is_some_and(|beside| beside.urgent || !self.unsafe_until_solved);
        if !self.advised || busy {
            return None;
        }
        let domain = self.solved.as_ref()?.domain.clone();
        self.advised = false;
        self.jobs += 1;
        self.beside = Some(Beside {
            number: self.jobs,
            urgent: self.unsafe_until_solved,
            since: Vec::new(),
        });
        Some(Job {
            number: self.jobs,
            urgent: self.unsafe_until_solved,
            domain,
        })
    }

    /// The job that runs beside the live field, if any.
    #[must_use]
    pub fn beside(&self) -> Option<u64> {
        self.beside.as_ref().map(|beside| beside.number)
    }

    /// Swap in what job `number` solved, brought up to date with what changed meanwhile. Says whether
    /// the live field is another now; the result of a stale job changes nothing.
    ///
    /// # Errors
    /// When it cannot be brought up to date; the live field stays.
    pub fn swap_in(
        &mut self,
        number: u64,
        mut domain: Domain,
        mut field: Field,
    ) -> Result<bool, SolveError> {
        let Some(beside) = self.beside.take_if(|beside| beside.number == number) else {
            return Ok(false);
        };
        self.unsafe_until_solved = false;
        if !beside.since.is_empty() {
            let verdict = self.solver.update(
                &mut domain,
                &mut field,
                &beside.since,
                &Cancellation::default(),
            )?;
            self.heed(verdict);
        }
        if let Some(solved) = &mut self.solved {
            solved.domain = domain;
            solved.field = field;
            self.full_solves += 1;
        }
        Ok(true)
    }

    /// Break like this, on purpose, with the robot at `position`. Says whether that could be done: whether the fault is
    /// the planner's, and there is a field.
    pub fn inject(&mut self, fault: FaultKind, position: DVec2) -> bool {
        match (fault, &mut self.solved) {
            (FaultKind::CorruptField, Some(solved)) => {
                let at = solved.frame.to_cells(position);
                solved.field.lead_astray([at.x, at.y]);
                true
            }
            (FaultKind::Saddle, _) => {
                self.on_a_saddle = true;
                true
            }
            _ => false,
        }
    }

    /// The reference direction for a robot at `pose`.
    #[must_use]
    pub fn guide(&self, pose: &Pose2) -> GuidanceSample {
        let to_target = self.target - pose.position;
        let (status, direction) = match &self.solved {
            None => (GuidanceStatus::Waiting, DVec2::ZERO),
            Some(_) if self.unsafe_until_solved => (GuidanceStatus::Waiting, DVec2::ZERO),
            Some(solved) => {
                let at = solved.frame.to_cells(pose.position);
                match solved.field.guidance(at.x, at.y) {
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
            self.look_first(pose, status, direction)
        };
        GuidanceSample {
            ex: direction.x,
            ey: direction.y,
            distance_m: to_target.length(),
            speed_limit_m_s: limit,
            status: status.into(),
            grid_version: self.grid.version(),
            safety_events: self.belief.safety_events,
            epoch: self.belief.epoch,
            full_solves: self.full_solves,
            local_updates: self.local_updates,
            ..GuidanceSample::default()
        }
    }

    /// The careful method's word on a direction: status, direction and speed limit to give.
    fn look_first(
        &self,
        pose: &Pose2,
        status: GuidanceStatus,
        direction: DVec2,
    ) -> (GuidanceStatus, DVec2, f64) {
        let (Some(lookout), Some(solved)) = (&self.lookout, &self.solved) else {
            return (status, direction, f64::INFINITY);
        };
        let view = View {
            frame: solved.frame,
            cells: self.grid.cells(),
            field: &solved.field,
        };
        match status {
            GuidanceStatus::Along => match lookout.advise(&view, pose, direction) {
                Advice::Look(there) => (GuidanceStatus::Look, there, 0.0),
                Advice::Go(limit) => (status, direction, limit),
            },
            GuidanceStatus::WayOut => (status, direction, WAY_OUT_M_S),
            // It may be an echo that was none: one look around before the belief is blamed.
            GuidanceStatus::Unreachable => (status, pose.axis().perp(), 0.0),
            _ => (status, direction, 0.0),
        }
    }

    /// The policy of every cell, and what the `field` topic says of it besides stamp and part; none before
    /// the first solve.
    #[must_use]
    pub fn policy(&self) -> Option<(FieldHeader, GridFrame, Vec<FieldCell>)> {
        let Solved { frame, field, .. } = self.solved.as_ref()?;
        let certificate = field.certificate();
        let header = FieldHeader {
            grid_version: self.grid.version(),
            target_x_m: self.target.x,
            target_y_m: self.target.y,
            worst_residual: certificate.worst_residual,
            reachable: certificate.reachable as u64,
            ..FieldHeader::default()
        };
        let side = frame.cells as usize;
        let cells = (0..side * side).map(|index| cell_policy(field, index % side, index / side));
        Some((header, *frame, cells.collect()))
    }
}

fn cell_policy(field: &Field, col: usize, row: usize) -> FieldCell {
    let cell = Cell::new(col, row);
    let [ex, ey] = field.direction(cell).unwrap_or_default();
    FieldCell {
        ex: ex as f32,
        ey: ey as f32,
        log2_u: field.u(cell).log2() as f32,
    }
}

/// Cells of `window` that are hazard now and were not when `domain` was solved, and the other way round.
fn changes_in(domain: &Domain, frame: &GridFrame, window: Window, cells: &[u8]) -> Vec<Change> {
    let mut changes = Vec::new();
    for row in window.row..window.row + window.height {
        for col in window.col..window.col + window.width {
            let cell = Cell::new(col as usize, row as usize);
            let blocked = is_hazard(cells[frame.index(common::grid::Cell { col, row })]);
            if blocked != domain.is_blocked(cell) {
                changes.push(Change { cell, blocked });
            }
        }
    }
    changes
}

const fn is_hazard(cell: u8) -> bool {
    CellState::from_byte(cell).is_hazard()
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::grid::Revision;
    use std::path::Path;

    fn mission() -> Mission {
        mission_of(40)
    }

    /// A perimeter of 4 m in so many cells a side.
    fn mission_of(cells: u32) -> Mission {
        let text = format!(
            "target = [1.5, 0]\nmethod = 'paper'\nperimeter = {{ width_m = 4, cells = {cells} }}"
        );
        Mission::parse(&text, Path::new("test.toml")).unwrap()
    }

    /// A keyframe with the perimeter, and `hazard` where it says so.
    fn keyframe(version: u64, hazard: impl Fn(DVec2) -> bool) -> (GridHeader, Vec<u8>) {
        keyframe_of(mission().grid_frame(), version, hazard)
    }

    fn keyframe_of(
        frame: GridFrame,
        version: u64,
        hazard: impl Fn(DVec2) -> bool,
    ) -> (GridHeader, Vec<u8>) {
        let cells = (0..frame.area() as u32).map(|index| {
            let cell = common::grid::Cell {
                col: index % frame.cells,
                row: index / frame.cells,
            };
            u8::from(frame.is_rim(cell) || hazard(frame.centre_of(cell)))
        });
        let header = GridHeader {
            part: Revision {
                frame,
                window: frame.whole(),
                version,
                keyframe: true,
            }
            .into(),
            ..GridHeader::default()
        };
        (header, cells.collect())
    }

    fn status(sample: &GuidanceSample) -> GuidanceStatus {
        GuidanceStatus::from_byte(sample.status)
    }

    fn at(x: f64, y: f64) -> Pose2 {
        Pose2 {
            position: DVec2::new(x, y),
            heading: 0.0,
        }
    }

    #[test]
    fn before_the_first_keyframe_there_is_no_guidance() {
        let planner = Planner::new(&mission());
        assert_eq!(
            status(&planner.guide(&at(0.0, 0.0))),
            GuidanceStatus::Waiting
        );
        assert!(planner.policy().is_none());
    }

    #[test]
    fn an_empty_room_is_crossed_straight() {
        let mut planner = Planner::new(&mission());
        let (header, cells) = keyframe(1, |_| false);
        assert_eq!(planner.take_grid(&header, &cells).unwrap(), Work::FullSolve);
        let guidance = planner.guide(&at(0.0, 0.0));
        assert_eq!(status(&guidance), GuidanceStatus::Along);
        assert!(
            guidance.ex > 0.999 && guidance.ey.abs() < 0.03,
            "{guidance:?}"
        );
        assert_eq!(guidance.distance_m, 1.5);
    }

    #[test]
    fn a_wall_that_appears_turns_the_guidance_aside() {
        let mut planner = Planner::new(&mission());
        let (header, cells) = keyframe(1, |_| false);
        planner.take_grid(&header, &cells).unwrap();
        // Open only above y = 1.
        let wall = |at: DVec2| (at.x - 0.7).abs() < 0.06 && at.y < 1.0;
        let (header, cells) = keyframe(2, wall);
        assert_eq!(
            planner.take_grid(&header, &cells).unwrap(),
            Work::LocalUpdate
        );
        let guidance = planner.guide(&at(0.3, 0.0));
        assert!(guidance.ey > 0.7, "{guidance:?}");
        assert_eq!((guidance.full_solves, guidance.local_updates), (1, 1));
    }

    #[test]
    fn a_robot_walled_in_is_told_that_the_target_is_unreachable() {
        let mut planner = Planner::new(&mission());
        let ring = |at: DVec2| (0.5..0.75).contains(&at.length());
        let (header, cells) = keyframe(1, ring);
        planner.take_grid(&header, &cells).unwrap();
        assert_eq!(
            status(&planner.guide(&at(0.0, 0.0))),
            GuidanceStatus::Unreachable
        );
    }

    #[test]
    fn a_robot_on_a_hazard_cell_is_shown_the_way_out() {
        let mut planner = Planner::new(&mission());
        let block = |at: DVec2| at.x.abs() < 0.25 && at.y.abs() < 0.45;
        let (header, cells) = keyframe(1, block);
        planner.take_grid(&header, &cells).unwrap();
        let guidance = planner.guide(&at(-0.15, 0.0));
        assert_eq!(status(&guidance), GuidanceStatus::WayOut);
        assert!(
            guidance.ex < -0.9,
            "the nearest free cell lies to the left: {guidance:?}"
        );
    }

    #[test]
    fn in_the_targets_cell_the_rest_is_straight() {
        let mut planner = Planner::new(&mission());
        let (header, cells) = keyframe(1, |_| false);
        planner.take_grid(&header, &cells).unwrap();
        let guidance = planner.guide(&at(1.48, 0.02));
        assert!((guidance.ex - 0.5_f64.sqrt()).abs() < 1e-9, "{guidance:?}");
    }

    /// A careful planner in a room where only what `swept` says was looked at.
    fn careful(swept: impl Fn(DVec2) -> bool) -> Planner {
        let mission = Mission {
            method: Method::Careful,
            ..mission()
        };
        let (header, mut cells) = keyframe(1, |_| false);
        let frame = mission.grid_frame();
        for (index, state) in cells.iter_mut().enumerate() {
            let cell = common::grid::Cell {
                col: index as u32 % frame.cells,
                row: index as u32 / frame.cells,
            };
            if *state == CellState::Free as u8 && swept(frame.centre_of(cell)) {
                *state = CellState::Swept as u8;
            }
        }
        let mut planner = Planner::new(&mission);
        planner.take_grid(&header, &cells).unwrap();
        planner
    }

    #[test]
    fn a_careful_robot_looks_where_nobody_looked_before_it_goes_there() {
        // All but what lies to the left of the way ahead.
        let planner = careful(|at| at.x < 0.2 || at.y < 0.1);
        let guidance = planner.guide(&at(0.0, 0.0));
        assert_eq!(status(&guidance), GuidanceStatus::Look);
        assert!(guidance.ex > 0.3 && guidance.ey > 0.1, "{guidance:?}");
        assert_eq!(guidance.speed_limit_m_s, 0.0);
    }

    #[test]
    fn over_swept_ground_a_careful_robot_goes_at_full_speed() {
        let guidance = careful(|_| true).guide(&at(0.0, 0.0));
        assert_eq!(status(&guidance), GuidanceStatus::Along);
        assert!(guidance.speed_limit_m_s > 0.25, "{guidance:?}");
    }

    #[test]
    fn a_scan_goes_on_in_a_planner_that_was_started_anew() {
        let swept = |at: DVec2| at.x < 0.2 || at.y < 0.1;
        let (one, other) = (careful(swept), careful(swept));
        for heading in [0.0, 0.2, 0.4] {
            let pose = Pose2 {
                heading,
                ..at(0.0, 0.0)
            };
            assert_eq!(one.guide(&pose), other.guide(&pose));
        }
    }

    /// A room of 200 x 200 cells with a wall across it and a door in the wall.
    fn large_room(version: u64, door_closed: bool) -> (Mission, GridHeader, Vec<u8>) {
        let mission = mission_of(200);
        let hazard = |at: DVec2| {
            let wall = (at.x - 0.8).abs() < 0.03;
            let far_door = (1.0..1.4).contains(&at.y);
            let near_door = !door_closed && at.y.abs() < 0.2;
            wall && !far_door && !near_door
        };
        let (header, cells) = keyframe_of(mission.grid_frame(), version, hazard);
        (mission, header, cells)
    }

    #[test]
    fn a_door_that_closes_halts_the_robot_until_the_full_solve_beside_is_swapped_in() {
        let (mission, header, cells) = large_room(1, false);
        let mut planner = Planner::new(&mission);
        planner.take_grid(&header, &cells).unwrap();
        assert!(
            planner.begin_beside().is_none(),
            "nothing calls for a solve"
        );
        let (_, header, cells) = large_room(2, true);
        planner.take_grid(&header, &cells).unwrap();
        let job = planner.begin_beside().unwrap();
        assert!(job.urgent);
        assert_eq!(
            status(&planner.guide(&at(0.0, 0.0))),
            GuidanceStatus::Waiting
        );
        assert!(planner.begin_beside().is_none(), "one at a time");
        let field = Solver::default()
            .solve(&job.domain, &Cancellation::default())
            .unwrap();
        assert!(planner.swap_in(job.number, job.domain, field).unwrap());
        let guidance = planner.guide(&at(0.5, 0.0));
        assert_eq!(status(&guidance), GuidanceStatus::Along);
        assert!(guidance.ey > 0.4, "to the other door: {guidance:?}");
    }

    #[test]
    fn the_result_of_a_stale_job_changes_nothing() {
        let (mission, header, cells) = large_room(1, false);
        let mut planner = Planner::new(&mission);
        planner.take_grid(&header, &cells).unwrap();
        let (_, header, closed) = large_room(2, true);
        planner.take_grid(&header, &closed).unwrap();
        let job = planner.begin_beside().unwrap();
        let field = Solver::default()
            .solve(&job.domain, &Cancellation::default())
            .unwrap();
        assert!(!planner.swap_in(job.number + 1, job.domain, field).unwrap());
        assert_eq!(
            status(&planner.guide(&at(0.0, 0.0))),
            GuidanceStatus::Waiting
        );
    }

    #[test]
    fn what_changes_while_a_job_runs_is_in_the_field_it_brings() {
        let (mission, header, cells) = large_room(1, false);
        let mut planner = Planner::new(&mission);
        planner.take_grid(&header, &cells).unwrap();
        let (_, header, mut cells) = large_room(2, true);
        planner.take_grid(&header, &cells).unwrap();
        let job = planner.begin_beside().unwrap();
        // A post between the robot and the other door.
        let frame = mission.grid_frame();
        let post = frame.cell_at(DVec2::new(0.4, 0.6)).unwrap();
        cells[frame.index(post)] = 1;
        let mut later = header;
        later.part.version = 3;
        planner.take_grid(&later, &cells).unwrap();
        let field = Solver::default()
            .solve(&job.domain, &Cancellation::default())
            .unwrap();
        planner.swap_in(job.number, job.domain, field).unwrap();
        assert_eq!(
            status(&planner.guide(&at(0.4, 0.6))),
            GuidanceStatus::WayOut
        );
    }

    #[test]
    fn a_missing_version_waits_for_a_keyframe() {
        let mut planner = Planner::new(&mission());
        let (mut header, _) = keyframe(5, |_| false);
        header.part.keyframe = 0;
        (header.part.width, header.part.height) = (1, 1);
        assert_eq!(planner.take_grid(&header, &[1]).unwrap(), Work::Missed);
    }

    #[test]
    fn the_policy_covers_every_cell_with_unit_vectors_or_nothing() {
        let mut planner = Planner::new(&mission());
        let (header, cells) = keyframe(1, |at| at.distance(DVec2::new(0.7, 0.3)) < 0.3);
        planner.take_grid(&header, &cells).unwrap();
        let (header, _, policy) = planner.policy().unwrap();
        assert_eq!((policy.len(), header.grid_version), (1600, 1));
        for (cell, &state) in policy.iter().zip(&cells) {
            let length = f64::from(cell.ex).hypot(f64::from(cell.ey));
            let directed = (length - 1.0).abs() < 1e-6;
            let target = cell.log2_u == 0.0;
            assert_eq!(
                directed || target,
                state == 0,
                "{cell:?} where the grid says {state}"
            );
        }
    }
}
