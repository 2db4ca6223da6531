//! The shortest path over the map, planned anew in every tick, like the global planners NavFn or A*: A* over eight neighbours
//! that cuts no corner, and guidance to the farthest point of the path that is near and in sight.

use common::{
    clock::MissionTime,
    grid::Cell,
    mission::Mission,
    samples::PoseSample,
    step::{ForeignState, Step},
};
use glam::DVec2;
use pathfinding::prelude::astar;

use crate::baselines::{
    belief::{Belief, Map},
    planner::{Guide, Input, Outcome, Way},
};

/// The robot heads for a point of its path that is no farther than this, metres.
const AIM_M: f64 = 0.6;
/// A* counts in thousandths of a cell.
const STRAIGHT: u64 = 1000;
const DIAGONAL: u64 = 1414;

/// The planner of shortest paths.
#[derive(Clone, Debug)]
pub struct Wavefront {
    guide: Guide,
    belief: Belief,
}

impl Step for Wavefront {
    type Input<'a> = Input<'a>;
    type Output = Outcome;
    /// It has no state: it plans from the map alone.
    type State = ();

    fn new(mission: &Mission) -> Self {
        Self { guide: Guide::new(mission), belief: Belief::default() }
    }

    fn state(&self) -> &() {
        &()
    }

    fn restore(&mut self, (): ()) -> Result<(), ForeignState> {
        Ok(())
    }

    fn step(&mut self, input: Input<'_>, _: MissionTime) -> Outcome {
        match input {
            Input::Grid { header, cells } if self.belief.follow(header, cells) => Outcome::Followed,
            Input::Grid { .. } => Outcome::Missed,
            Input::Pose(pose) => {
                let way = self.way(pose);
                Outcome::Guidance(self.guide.sample(pose, way, self.belief.header()))
            }
        }
    }
}

impl Wavefront {
    fn way(&self, pose: &PoseSample) -> Way {
        let here = pose.pose().position;
        let Some(map) = self.belief.map() else {
            return Way::Unknown;
        };
        let Some(start) = map.free_cell_at(here) else {
            return Way::out(&map, here);
        };
        let goal = map.free_cell_at(self.guide.target);
        let path = goal.and_then(|goal| shortest_path(&map, start, goal));
        path.map_or(Way::None, |path| Way::To(self.aim(&map, here, &path)))
    }

    /// The farthest point of `path` within [`AIM_M`] that a robot at `here` (metres) sees; the next one if it sees none.
    fn aim(&self, map: &Map<'_>, here: DVec2, path: &[Cell]) -> DVec2 {
        let last = path.len() - 1;
        let point = |index: usize| match path.get(index) {
            Some(&cell) if index < last => map.frame.centre_of(cell),
            _ => self.guide.target,
        };
        let near = (1..=last)
            .rev()
            .map(point)
            .find(|&point| here.distance(point) <= AIM_M && map.sees(here, point));
        near.unwrap_or_else(|| point(1))
    }
}

/// The cells of the shortest path between two free cells, both of them included.
fn shortest_path(map: &Map<'_>, start: Cell, goal: Cell) -> Option<Vec<Cell>> {
    let octile = |cell: &Cell| {
        let (cols, rows) = (cell.col.abs_diff(goal.col), cell.row.abs_diff(goal.row));
        let (less, more) = (u64::from(cols.min(rows)), u64::from(cols.max(rows)));
        less * DIAGONAL + (more - less) * STRAIGHT
    };
    let successors = |&cell: &Cell| {
        let steps = (-1..=1).flat_map(|rows| (-1..=1).map(move |cols| [cols, rows]));
        steps.filter_map(move |step| {
            let length = match step {
                [0, 0] => return None,
                [0, _] | [_, 0] => STRAIGHT,
                _ => DIAGONAL,
            };
            Some((map.neighbour(cell, step)?, length))
        })
    };
    astar(&start, successors, octile, |&cell| cell == goal).map(|(path, _)| path)
}

#[cfg(test)]
mod tests;
