//! The shortest path over the map, planned anew in every tick, like the global planners NavFn or A*: A* over eight neighbours
//! that cuts no corner, and guidance to the farthest point of the path that is near and in sight.

use common::grid::Cell;
use glam::DVec2;
use report::shortest_path::over_neighbours;
use serde::{Deserialize, Serialize};

use crate::baselines::{
    belief::Map,
    planner::{Planner, Way},
};

/// The greatest distance to the point of its path for which the robot heads, metres.
const AIM_M: f64 = 0.6;

/// The planner of shortest paths. It plans from the map alone.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct Wavefront;

impl Planner for Wavefront {
    fn way(&mut self, map: &Map<'_>, here: DVec2, target: DVec2) -> Way {
        let Some(start) = map.free_cell_at(here) else {
            return Way::out(map, here);
        };
        let goal = map.free_cell_at(target);
        let path = goal.and_then(|goal| shortest_path(map, start, goal));
        path.map_or(Way::None, |path| Way::To(aim(map, here, target, &path)))
    }
}

/// The farthest point of `path` within [`AIM_M`] that a robot at `here` (metres) sees; the next one if it sees none.
fn aim(map: &Map<'_>, here: DVec2, target: DVec2, path: &[Cell]) -> DVec2 {
    let last = path.len() - 1;
    let point = |index: usize| match path.get(index) {
        Some(&cell) if index < last => map.frame.centre_of(cell),
        _ => target,
    };
    let near = (1..=last)
        .rev()
        .map(point)
        .find(|&point| here.distance(point) <= AIM_M && map.sees(here, point));
    near.unwrap_or_else(|| point(1))
}

/// The cells of the shortest path between two free cells, both of them included.
fn shortest_path(map: &Map<'_>, start: Cell, goal: Cell) -> Option<Vec<Cell>> {
    let apart = |cell: Cell| [cell.col.abs_diff(goal.col), cell.row.abs_diff(goal.row)];
    over_neighbours(start, goal, apart, |cell, step| map.neighbour(cell, step))
}

#[cfg(test)]
mod tests;
