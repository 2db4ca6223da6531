//! Shortest-path planner, replanned each tick, like the global planners NavFn or A*.
//!
//! Searches by A* over eight neighbours without cutting corners. Guides to the farthest near point
//! of the path in sight.

use common::grid::Cell;
use glam::DVec2;
use report::shortest_path::over_neighbours;

use crate::baselines::{map::Map, planner::Way};

/// Maximum distance to the path point that the robot heads for.
const AIM_M: f64 = 0.6;

pub fn way(map: &Map<'_>, here: DVec2, target: DVec2) -> Way {
    let Some(start) = map.free_cell_at(here) else {
        return map.nearest_free(here).map_or(Way::None, Way::Out);
    };
    let goal = map.free_cell_at(target);
    let path = goal.and_then(|goal| shortest_path(map, start, goal));
    path.map_or(Way::None, |path| Way::To(aim(map, here, target, &path)))
}

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

pub fn shortest_path(map: &Map<'_>, start: Cell, goal: Cell) -> Option<Vec<Cell>> {
    let apart = |cell: Cell| [cell.col.abs_diff(goal.col), cell.row.abs_diff(goal.row)];
    over_neighbours(start, goal, apart, |cell, step| map.free_neighbour(cell, step))
}

#[cfg(test)]
mod tests;
