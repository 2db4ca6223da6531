//! The stage, pure: follow the `grid`, keep the field right, answer for a pose.

use common::{
    grid::{Applied, CellState, GridFrame, Replica, Window},
    kinematics::Pose2,
    mission::{Method, Mission},
    samples::{FaultKind, FieldCell, FieldHeader, GridHeader, GuidanceSample, GuidanceStatus},
};
use glam::DVec2;
use harmonic::{
    Cancellation, Cell, Change, Domain, Field, Guidance, Screening, Settings, SolveError, Solver,
    Verdict,
};

use crate::{
    fault::lead_astray,
    lookout::{Advice, Lookout, View},
};

/// Maps of at most this many cells are solved in full at once where a local update is not enough: that takes less
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
    screening: Screening,
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
            screening: screening(mission),
            lookout: (mission.method == Method::Evidential).then(|| Lookout::new(mission)),
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
        let domain =
            Domain::new(side, side, blocked.collect(), target)?.with_screening(&self.screening)?;
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
        if verdict != Verdict::Accurate && solved.frame.area() <= SMALL {
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
        self.advised |= verdict != Verdict::Accurate;
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
                lead_astray(&mut solved.field, [at.x, at.y]);
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
        let verification = field.verification();
        let header = FieldHeader {
            grid_version: self.grid.version(),
            target_x_m: self.target.x,
            target_y_m: self.target.y,
            worst_residual: verification.worst_residual,
            reachable: verification.reachable as u64,
            ..FieldHeader::default()
        };
        let side = frame.cells as usize;
        let cells = (0..side * side).map(|index| cell_policy(field, index % side, index / side));
        Some((header, *frame, cells.collect()))
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
mod tests;
