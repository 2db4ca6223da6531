//! From a map, a start and goals to a path along the harmonic field. Pure.

use std::{collections::VecDeque, sync::Arc};

use glam::{DAffine2, DVec2};
use harmonic::{Cancellation, Cell, Domain, Field, Guidance, Screening, SolveError, Solver};
use ros2::parts::Pose;

use super::costmap::{Body, Costmap};

/// Most cells of stored fields, those of the newest goals.
const MOST_CELLS: usize = 1 << 24;
/// Step along the field, in cells. Near a wall the field points away from it or along it.
const STEP: f64 = 0.25;
/// Shortest screening length, in cells. u then falls to about a third from cell to cell.
const SHORTEST: f64 = 0.5;
/// Largest path, bytes. DDS here does not fragment answers above 64 kB, path and rest.
const MOST_BYTES: usize = 64_000;
/// Bytes of a pose without its frame name: stamp, name length, padding, position and orientation.
const POSE_BYTES: usize = 76;
/// Step of the checks along a chord, in cells.
const LOOK: f64 = 0.0625;
const MOST_GOALS: usize = 100;

/// Failure reasons: Nav2's error codes minus 200 for one goal, and minus 300 for several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    Unknown = 0,
    Tf = 2,
    StartOutside,
    GoalOutside,
    StartOccupied,
    GoalOccupied,
    Timeout,
    NoPath,
    NoGoal,
}

pub type Failure = (Reason, String);

#[derive(Debug, Default)]
pub struct Planner {
    body: Body,
    screening_m: f64,
    solver: Solver,
    map: Option<Arc<Costmap>>,
    blocked: Vec<bool>,
    costs: Vec<f32>,
    /// Fields and their domains, the newest path's last.
    fields: VecDeque<(Domain, Field)>,
}

impl Planner {
    pub fn new(body: Body, screening_m: f64) -> Self {
        Self { body, screening_m, ..Self::default() }
    }

    /// Returns poses through all `goals`, about a cell apart, farther on long paths. Goals keep
    /// their headings.
    pub fn plan(
        &mut self,
        map: &Arc<Costmap>,
        start: DAffine2,
        goals: &[DAffine2],
        cancellation: &Cancellation,
    ) -> Result<Vec<Pose>, Failure> {
        if goals.is_empty() {
            return Err((Reason::NoGoal, "no goal was given".to_owned()));
        }
        if goals.len() > MOST_GOALS {
            return Err((Reason::Unknown, format!("a path has at most {MOST_GOALS} goals")));
        }
        let before = self.map.replace(Arc::clone(map));
        if before.is_none_or(|before| !Arc::ptr_eq(&before, map)) {
            let most = self.screening_m / map.resolution_m / SHORTEST;
            (self.blocked, self.costs) = map.blocked_and_costs(&self.body, most as f32);
        }
        let (mut path, mut ends) = (Vec::new(), Vec::new());
        let mut from = start.translation;
        for goal in goals {
            let to = goal.translation;
            let leg = self.leg(map, [from, to], cancellation)?;
            // The last position may be anywhere in the goal's cell.
            let next = leg.iter().skip(1).take(leg.len().saturating_sub(2)).chain([&to]);
            path.extend(leg.iter().zip(next).map(|(at, to)| [at.x, at.y, (to - at).to_angle()]));
            ends.push(path.len());
            path.push([to.x, to.y, goal.matrix2.x_axis.to_angle()]);
            from = to;
        }
        self.thinned(map, &path, &ends)
    }

    /// Thins a path to one answer. Keeps `ends`, and chords clear of blocked cells.
    fn thinned(&self, map: &Costmap, path: &[Pose], ends: &[usize]) -> Result<Vec<Pose>, Failure> {
        let most = MOST_BYTES / (POSE_BYTES + map.frame.len());
        let mut stride = path.len().div_ceil(most);
        while stride <= path.len() {
            let kept = self.strided(map, path, ends, stride);
            if kept.len() <= most {
                return Ok(kept);
            }
            stride += stride.div_ceil(4);
        }
        Err((
            Reason::Unknown,
            format!("the path has more than {most} bends, the limit of one answer"),
        ))
    }

    /// Returns poses at most `stride` apart, closer beside blocked cells.
    fn strided(&self, map: &Costmap, path: &[Pose], ends: &[usize], stride: usize) -> Vec<Pose> {
        let cells = map.place.inverse();
        let place = |at: usize| cells.transform_point2(DVec2::new(path[at][0], path[at][1]));
        let is_free = |from: DVec2, to: DVec2| {
            let steps = (from.distance(to) / LOOK).ceil().max(1.0);
            (0..=steps as usize).all(|step| {
                let at = from.lerp(to, step as f64 / steps);
                map.cell_at(at).is_some_and(|cell| !self.blocked[cell.row * map.width + cell.col])
            })
        };
        let (mut kept, mut at) = (Vec::new(), 0);
        for &end in ends {
            while at < end {
                kept.push(path[at]);
                let mut ahead = stride.min(end - at);
                while ahead > 1 && !is_free(place(at), place(at + ahead)) {
                    ahead = ahead * 3 / 4;
                }
                at += ahead;
            }
            kept.push(path[end]);
            at = end + 1;
        }
        kept
    }

    pub fn newest_field(&self) -> Option<&Field> {
        self.fields.back().map(|(_, field)| field)
    }

    /// Returns positions in the frame of `map`, from the first of `ends` to the cell of the second.
    fn leg(
        &mut self,
        map: &Costmap,
        ends: [DVec2; 2],
        cancellation: &Cancellation,
    ) -> Result<Vec<DVec2>, Failure> {
        let [start, goal] = ends.map(|end| format!("({:.2}, {:.2})", end.x, end.y));
        let [from, to] = ends.map(|end| map.place.inverse().transform_point2(end));
        let first = map.cell_at(from).ok_or_else(|| {
            (Reason::StartOutside, format!("the start {start} is outside the map"))
        })?;
        let last = map
            .cell_at(to)
            .ok_or_else(|| (Reason::GoalOutside, format!("the goal {goal} is outside the map")))?;
        if map.is_occupied(first, &self.body) {
            return Err((Reason::StartOccupied, format!("the start {start} is occupied")));
        }
        if self.blocked[last.row * map.width + last.col] {
            return Err((
                Reason::GoalOccupied,
                format!("the goal {goal} is occupied, or the robot does not fit there"),
            ));
        }
        let body = self.body;
        let field = self.field(map, last, cancellation).map_err(|error| match error {
            SolveError::Cancelled => {
                (Reason::Timeout, "the field was not solved in time".to_owned())
            }
            error => (Reason::Unknown, error.to_string()),
        })?;
        let enters = |at: DVec2| map.cell_at(at).is_some_and(|cell| !map.is_occupied(cell, &body));
        let way = way(field, from, enters)
            .ok_or_else(|| (Reason::NoPath, format!("no path leads from {start} to {goal}")))?;
        Ok(way.into_iter().map(|at| map.place.transform_point2(at)).collect())
    }

    /// Returns a goal's field, warm-started from an earlier map's.
    fn field(
        &mut self,
        map: &Costmap,
        goal: Cell,
        cancellation: &Cancellation,
    ) -> Result<&Field, SolveError> {
        let domain = Domain::new(map.width, map.height, self.blocked.clone(), goal)?
            .with_screening(&Screening::cells(self.screening_m / map.resolution_m))?
            .with_costs(self.costs.clone())?;
        let known = self.fields.iter().position(|(_, field)| field.target() == goal);
        let field = match known.and_then(|at| self.fields.remove(at)) {
            Some((of, field)) if of == domain => field,
            Some((_, near)) => self.solver.solve_near(&domain, &near, cancellation)?,
            None => self.solver.solve(&domain, cancellation)?,
        };
        let most = MOST_CELLS / self.blocked.len();
        self.fields.drain(..self.fields.len().saturating_sub(most));
        Ok(&self.fields.push_back_mut((domain, field)).1)
    }
}

/// Returns positions about a cell apart along `field`, if it leads to its target.
fn way(field: &Field, from: DVec2, enters: impl Fn(DVec2) -> bool) -> Option<Vec<DVec2>> {
    let mut at = from;
    let mut way = vec![from];
    // Upper bound on the steps of a path over all cells.
    for _ in 0..field.width() * field.height() * (2.0 / STEP) as usize {
        let ahead = match field.guidance(at.x, at.y) {
            Guidance::AtTarget => {
                way.push(at);
                return Some(way);
            }
            Guidance::Along(ahead) => ahead,
            Guidance::WayOut(ahead) if enters(at) => ahead,
            Guidance::WayOut(_) | Guidance::Unreachable => return None,
        };
        at += STEP * DVec2::from(ahead);
        if way.last().is_none_or(|last| at.distance(*last) >= 1.0) {
            way.push(at);
        }
    }
    None
}
