//! Newest map and the field that follows it.
//!
//! | event | [`Current`](State::Current) | [`Stale`](State::Stale) | [`Solving`](State::Solving) |
//! |---|---|---|---|
//! | map changes | `Stale` | `Stale` | `Solving`, `changed` |
//! | tick ends, small map | `Current` | solved: `Current` | - |
//! | tick ends, large map | `Current` | a job begins: `Solving` | `Solving` |
//! | result of the job | ignored | ignored | `Current`, or `Stale` if `changed` |
//!
//! A robot follows an outdated field only where nothing changed ahead. Elsewhere a small map is
//! solved within the tick, and on a large one the robot waits. Each tick checks the way again. On a
//! wall clock, a tick is answered once more when its map is solved.

use std::sync::Arc;

use common::{
    grid::{self, CellState, GridFrame, Window},
    kinematics::Pose2,
    mission::Mission,
    samples::GuidanceStatus,
};
use glam::DVec2;
use harmonic::{Cell, Change, Domain, Field, Guidance, SolveError};

use super::output::{Job, Solved};
use crate::view::{View, field_cell};

/// Limit of cells (512 x 512) for a solve within the step; larger maps are solved in the
/// background.
const SMALL_CELLS: usize = 1 << 18;

/// Time horizon of the way that must be unchanged, seconds: until the next tick looks again, and
/// then to stop.
const AHEAD_S: f64 = 0.8;

/// Distance to the field's cell beside the target at which the robot has arrived, metres.
const AT_CELL_M: f64 = 0.12;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Current,
    /// No solve of it has begun.
    Stale,
    /// Background solver runs `job` on `version`; `changed` says whether the map changed since.
    Solving {
        job: u64,
        version: u64,
        changed: bool,
    },
}

#[derive(Debug)]
pub(super) struct Live {
    pub frame: GridFrame,
    pub map: Domain,
    /// Field of `map` or of an older one; shared with its snapshots.
    pub field: Arc<Field>,
    field_version: u64,
    /// Whether the field leads to the previous target and must not be followed.
    leads_elsewhere: bool,
    /// Refused cells, row-major; empty if there are none.
    refused: Vec<bool>,
    state: State,
}

impl Live {
    pub(super) fn new(frame: GridFrame, map: Domain, field: Field) -> Self {
        let field = Arc::new(field);
        Self {
            frame,
            map,
            field,
            field_version: 0,
            leads_elsewhere: false,
            refused: Vec::new(),
            state: State::Current,
        }
    }

    /// Returns whether the field is outdated and the step itself solves the newest map.
    pub(super) fn is_solved_here(&self) -> bool {
        self.frame.area() <= SMALL_CELLS && self.state != State::Current
    }

    pub(super) fn map_changed(&mut self, before: u64) {
        match &mut self.state {
            State::Current => {
                self.field_version = before;
                self.state = State::Stale;
            }
            State::Stale => {}
            State::Solving { changed, .. } => *changed = true,
        }
    }

    /// Marks the field as outdated at `version` and drops the awaited job.
    pub(super) fn target_changed(&mut self, version: u64) {
        self.map_changed(version);
        self.leads_elsewhere = true;
        self.state = State::Stale;
    }

    pub(super) fn begin_job(&mut self, number: u64, version: u64) -> Option<Job> {
        if self.state != State::Stale {
            return None;
        }
        self.state = State::Solving { job: number, version, changed: false };
        let domain = self.map.clone();
        Some(Job { number, domain })
    }

    pub(super) fn take(&mut self, solved: Solved) -> Result<bool, SolveError> {
        match self.state {
            State::Solving { job, version, changed } if job == solved.number => {
                self.follow(solved.field?);
                self.field_version = version;
                if changed {
                    self.state = State::Stale;
                }
                Ok(true)
            }
            _ => Ok(false),
        }
    }

    pub(super) fn follow(&mut self, field: Arc<Field>) {
        self.field = field;
        self.leads_elsewhere = false;
        self.state = State::Current;
    }

    pub(super) fn field_version(&self, newest: u64) -> u64 {
        match self.state {
            State::Current => newest,
            State::Stale | State::Solving { .. } => self.field_version,
        }
    }

    /// Returns status and direction at `pose`; `None` where the field must not be followed.
    pub(super) fn guide(
        &self,
        mission: &Mission,
        pose: &Pose2,
        target: DVec2,
        cells: &[u8],
    ) -> Option<(GuidanceStatus, DVec2)> {
        if self.leads_elsewhere {
            return None;
        }
        if self.is_beside(target, pose.position) {
            return Some((GuidanceStatus::AtTarget, pose.axis()));
        }
        let view = self.view(cells);
        let (status, direction) = match view.guidance(pose.position) {
            Guidance::Along(direction) => (GuidanceStatus::Along, direction.into()),
            Guidance::WayOut(direction) => (GuidanceStatus::WayOut, direction.into()),
            // Inside its cell the field ends, so the robot drives straight to the target.
            Guidance::AtTarget => {
                let to_target = target - pose.position;
                (GuidanceStatus::Along, to_target.normalize_or(DVec2::X))
            }
            Guidance::Unreachable => (GuidanceStatus::Unreachable, DVec2::ZERO),
        };
        let follow = match (self.state, status) {
            (State::Current, _) => true,
            // The newest map may have a way.
            (_, GuidanceStatus::Unreachable) => false,
            _ => {
                let way = view.way(pose.position, direction, mission.speed_m_s() * AHEAD_S);
                let radius_m = mission.body().radius_m;
                let mut points = std::iter::once(pose.position).chain(way);
                !points.any(|at| view.has_changed(at, radius_m))
            }
        };
        follow.then_some((status, direction))
    }

    pub(super) fn view<'a>(&'a self, cells: &'a [u8]) -> View<'a> {
        View { frame: self.frame, cells, field: &self.field, refused: &self.refused }
    }

    pub(super) fn refuse(&mut self, cells: &[grid::Cell], version: u64) -> Result<(), SolveError> {
        self.refused.resize(self.frame.area(), false);
        cells.iter().for_each(|cell| self.refused[self.frame.index(*cell)] = true);
        self.map_changed(version);
        self.refuse_again()
    }

    pub(super) fn refuse_again(&mut self) -> Result<(), SolveError> {
        let refused = self.refused.iter().enumerate().filter(|(_, refused)| **refused);
        let side = self.frame.cells as usize;
        let cells = refused.map(|(index, _)| Cell::new(index % side, index / side));
        let cells = cells.filter(|cell| *cell != self.map.target());
        let changes: Vec<_> = cells.map(|cell| Change { cell, blocked: true }).collect();
        self.map.apply(&changes)
    }

    /// Forgets the refused cells and returns whether there were any; they stay in `map` until it is
    /// new.
    pub(super) fn forget_refused(&mut self) -> bool {
        let refused = std::mem::take(&mut self.refused);
        refused.contains(&true)
    }

    fn is_beside(&self, target: DVec2, robot: DVec2) -> bool {
        let Cell { col, row } = self.field.target();
        let aim = grid::Cell { col: col as u32, row: row as u32 };
        let own = self.frame.cell_at(target) == Some(aim);
        !own && self.frame.centre_of(aim).distance(robot) <= AT_CELL_M
    }

    pub(super) fn changes_in(&self, window: Window, cells: &[u8]) -> Vec<Change> {
        let view = self.view(cells);
        let changed = window.cells().filter_map(|cell| {
            let blocked = is_hazard(cells[self.frame.index(cell)]) || view.is_refused(cell);
            let cell = field_cell(cell);
            // The target's cell counts as free.
            let changed = cell != self.map.target() && blocked != self.map.is_blocked(cell);
            changed.then_some(Change { cell, blocked })
        });
        changed.collect()
    }
}

pub(super) const fn is_hazard(cell: u8) -> bool {
    CellState::from_byte(cell).is_hazard()
}
