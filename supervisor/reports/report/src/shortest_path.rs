//! Shortest path of a body from start to target.
//!
//! The body is a disc on a grid of 5 cm. Cells nearer to an obstacle than its radius are blocked.
//! A* over eight neighbours finds a path, and straight lines shorten it. The result is at most some
//! percent too long. A gap is open if it is wider than the body by a cell.

use std::hash::Hash;

use common::geometry::{Piece, Shapes};
use glam::{DVec2, IVec2};
use pathfinding::prelude::astar;

const CELL_M: f64 = 0.05;
/// Margin around start, target and obstacles, metres.
const RIM_M: f64 = 0.5;
/// Most cells of a world: 100 m by 100 m.
const MOST_CELLS: f64 = 4e6;
/// Costs of A*, thousandths of a cell.
const STRAIGHT: u32 = 1000;
const DIAGONAL: u32 = 1414;

/// Returns the shortest path length of a disc of `radius` metres from `start` to `target` among
/// `shapes`, metres.
///
/// Returns `None` without a path or in a too large world.
pub fn shortest_path(shapes: &Shapes, start: DVec2, target: DVec2, radius: f64) -> Option<f64> {
    let grid = Grid::new(shapes, start, target, radius)?;
    let (from, to) = (grid.cell(start), grid.cell(target));
    if !grid.is_free(from) || !grid.is_free(to) {
        return None;
    }
    let apart = |cell: IVec2| (cell - to).abs().as_uvec2().to_array();
    let cells = over_neighbours(from, to, apart, |cell, step| grid.neighbour(cell, step))?;
    Some(grid.straightened(&cells, start, target))
}

/// Returns the shortest path over eight neighbours from `start` to `goal`, including both.
///
/// `apart` returns the columns and rows from a cell to the goal, `neighbour` the free cell at such
/// a step. A diagonal step cuts no blocked corner.
pub fn over_neighbours<C: Copy + Eq + Hash>(
    start: C,
    goal: C,
    apart: impl Fn(C) -> [u32; 2],
    neighbour: impl Fn(C, [i32; 2]) -> Option<C>,
) -> Option<Vec<C>> {
    let octile = |&cell: &C| {
        let [cols, rows] = apart(cell);
        cols.min(rows) * DIAGONAL + cols.abs_diff(rows) * STRAIGHT
    };
    let steps: Vec<_> = (-1..=1)
        .flat_map(|rows| (-1..=1).map(move |cols| [cols, rows]))
        .filter(|step| *step != [0, 0])
        .collect();
    let neighbours = |&cell: &C| {
        let next = |&step: &[i32; 2]| {
            let length = if step.contains(&0) { STRAIGHT } else { DIAGONAL };
            let [cols, rows] = step;
            neighbour(cell, [cols, 0])?;
            neighbour(cell, [0, rows])?;
            Some((neighbour(cell, step)?, length))
        };
        steps.iter().filter_map(next).collect::<Vec<_>>()
    };
    astar(&start, neighbours, octile, |&cell| cell == goal).map(|(path, _)| path)
}

struct Grid {
    /// Centre of the cell (0, 0), metres.
    origin: DVec2,
    size: IVec2,
    blocked: Vec<bool>,
}

impl Grid {
    fn new(shapes: &Shapes, start: DVec2, target: DVec2, radius: f64) -> Option<Self> {
        let (least, greatest) = shapes.bounds_with(start, target);
        let rim = DVec2::splat(radius + RIM_M);
        let origin = least - rim;
        let size = ((greatest + rim - origin) / CELL_M).ceil() + 1.0;
        let cells = size.x * size.y;
        if cells.is_nan() || cells > MOST_CELLS {
            return None;
        }
        let mut grid = Self { origin, size: size.as_ivec2(), blocked: vec![false; cells as usize] };
        shapes.pieces().for_each(|piece| grid.block(&piece, radius));
        Some(grid)
    }

    fn block(&mut self, piece: &Piece<'_>, radius: f64) {
        let (least, greatest) = piece.bounds();
        let from = self.cell(least - radius).max(IVec2::ZERO);
        let to = self.cell(greatest + radius).min(self.size - 1);
        for y in from.y..=to.y {
            for x in from.x..=to.x {
                let cell = IVec2::new(x, y);
                if piece.clearance(self.centre(cell)) < radius
                    && let Some(index) = self.index(cell)
                {
                    self.blocked[index] = true;
                }
            }
        }
    }

    fn cell(&self, at: DVec2) -> IVec2 {
        ((at - self.origin) / CELL_M).round().as_ivec2()
    }

    fn centre(&self, cell: IVec2) -> DVec2 {
        self.origin + cell.as_dvec2() * CELL_M
    }

    /// Returns `None` outside the grid.
    fn index(&self, cell: IVec2) -> Option<usize> {
        let is_inside = cell.cmpge(IVec2::ZERO).all() && cell.cmplt(self.size).all();
        is_inside.then(|| (cell.y * self.size.x + cell.x) as usize)
    }

    fn is_free(&self, cell: IVec2) -> bool {
        self.index(cell).is_some_and(|index| !self.blocked[index])
    }

    fn neighbour(&self, cell: IVec2, step: [i32; 2]) -> Option<IVec2> {
        Some(cell + IVec2::from(step)).filter(|&next| self.is_free(next))
    }

    fn straightened(&self, cells: &[IVec2], start: DVec2, target: DVec2) -> f64 {
        let mut points: Vec<DVec2> = cells.iter().map(|&cell| self.centre(cell)).collect();
        if let Some(first) = points.first_mut() {
            *first = start;
        }
        if let Some(last) = points.last_mut() {
            *last = target;
        }
        assert!(!points.is_empty());
        let (mut length, mut at) = (0.0, 0);
        while at + 1 < points.len() {
            let farthest = (at + 1..points.len())
                .rev()
                .find(|&next| self.sees(points[at], points[next]))
                .unwrap_or(at + 1);
            length += points[at].distance(points[farthest]);
            at = farthest;
        }
        length
    }

    fn sees(&self, from: DVec2, to: DVec2) -> bool {
        let steps = (from.distance(to) / (CELL_M / 2.0)).ceil().max(1.0);
        (0..=steps as u32)
            .all(|step| self.is_free(self.cell(from.lerp(to, f64::from(step) / steps))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::geometry::Wall;

    fn wall(points: &[[f64; 2]]) -> Shapes {
        Shapes {
            walls: vec![Wall {
                points: points.iter().map(|&point| point.into()).collect(),
                ..Wall::default()
            }],
            ..Shapes::default()
        }
    }

    #[test]
    fn a_straight_way_is_straight_and_one_around_a_wall_is_as_long_as_by_hand() {
        let way = |shapes: &Shapes, to| shortest_path(shapes, DVec2::ZERO, to, 0.2).unwrap();
        let straight = way(&Shapes::default(), DVec2::new(3.0, 1.0));
        assert!((straight - 10_f64.sqrt()).abs() < 1e-9, "{straight}");
        // The path leads around the end at (1, 1) at the body's radius: two legs of about sqrt(1 +
        // 1.2^2).
        let around = way(&wall(&[[1.0, -9.0], [1.0, 1.0]]), DVec2::new(2.0, 0.0));
        assert!((3.0..3.25).contains(&around), "{around}");
    }

    #[test]
    fn a_gap_narrower_than_the_body_is_no_way_and_a_wider_one_is() {
        let room = |gap: f64| {
            let mut shapes =
                wall(&[[-1.0, -1.0], [3.0, -1.0], [3.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]]);
            for side in [-1.0, 1.0] {
                shapes.walls.extend(wall(&[[1.0, side], [1.0, side * gap / 2.0]]).walls);
            }
            shortest_path(&shapes, DVec2::ZERO, DVec2::new(2.0, 0.0), 0.2)
        };
        assert_eq!(room(0.35), None);
        assert!(room(0.55).is_some());
    }
}
