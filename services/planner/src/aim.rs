//! Cell that the field leads to.
//!
//! The target is a point in the world, and the pose drifts. The robot may therefore find the
//! target's cell where its body cannot be. The field then leads to the nearest free cell, where the
//! robot counts as arrived.
//!
//! The paper's method never marks the target's own cell, but margins may surround it. The field
//! then leads to a free cell within the arrival tolerance.

use common::grid::{Cell, CellState, GridFrame};
use glam::DVec2;

/// Limit of the distance from that cell to the target, metres; less than the width of the body.
const REACH_M: f64 = 0.35;

/// Returns the nearest cell to `target` with free cells all around, else the target's own; `None`
/// outside the map.
pub(crate) fn cell(frame: &GridFrame, cells: &[u8], target: DVec2) -> Option<Cell> {
    let own = frame.cell_at(target)?;
    let is_open = |cell: Cell| around(frame, cell, 1).all(|cell| is_free(frame, cells, cell));
    nearest(frame, (own, frame.centre_of(own)), REACH_M, is_open)
        .or_else(|| cell_with_a_way_in(frame, cells, target, REACH_M))
}

/// Returns the nearest free cell within `reach_m` that has a free neighbour, else the target's own;
/// `None` outside the map.
pub(crate) fn cell_with_a_way_in(
    frame: &GridFrame,
    cells: &[u8],
    target: DVec2,
    reach_m: f64,
) -> Option<Cell> {
    let own = frame.cell_at(target)?;
    let can_be_entered = |cell: Cell| {
        let beside = |next: &Cell| (next.col == cell.col) != (next.row == cell.row);
        let mut next = around(frame, cell, 1).filter(beside);
        is_free(frame, cells, cell) && next.any(|next| is_free(frame, cells, next))
    };
    nearest(frame, (own, target), reach_m, can_be_entered).or(Some(own))
}

fn is_free(frame: &GridFrame, cells: &[u8], cell: Cell) -> bool {
    debug_assert_eq!(cells.len(), frame.area());
    !CellState::from_byte(cells[frame.index(cell)]).is_hazard()
}

fn nearest(
    frame: &GridFrame,
    (own, place): (Cell, DVec2),
    reach_m: f64,
    fits: impl Fn(Cell) -> bool,
) -> Option<Cell> {
    let distance = |cell: &Cell| frame.centre_of(*cell).distance(place);
    let others = around(frame, own, (reach_m / frame.resolution_m) as u32);
    assert!(reach_m >= 0.0 && own.col < frame.cells && own.row < frame.cells);
    let own = Some(own).filter(|own| fits(*own));
    own.or_else(|| {
        others
            .filter(|cell| distance(cell) <= reach_m && fits(*cell))
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
    })
}

fn around(frame: &GridFrame, middle: Cell, reach: u32) -> impl Iterator<Item = Cell> + use<> {
    let last = frame.cells - 1;
    let span = move |at: u32| at.saturating_sub(reach)..=(at + reach).min(last);
    span(middle.row).flat_map(move |row| span(middle.col).map(move |col| Cell { col, row }))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: GridFrame = GridFrame { cells: 41, resolution_m: 0.05, centre: DVec2::ZERO };

    fn map(is_hazard: impl Fn(DVec2) -> bool) -> Vec<u8> {
        let state = |at| if is_hazard(at) { CellState::Sensed } else { CellState::Free };
        FRAME.whole().cells().map(|cell| state(FRAME.centre_of(cell)) as u8).collect()
    }

    fn aim(target: DVec2, is_hazard: impl Fn(DVec2) -> bool) -> Option<DVec2> {
        cell(&FRAME, &map(is_hazard), target).map(|cell| FRAME.centre_of(cell))
    }

    #[test]
    fn a_target_is_aimed_at_itself_unless_a_free_side_of_its_wall_is_near() {
        let target = DVec2::new(0.5, 0.0);
        let wall = |at: DVec2| (0.43..0.72).contains(&at.x);
        assert!(aim(target, wall).unwrap().distance(DVec2::new(0.35, 0.0)) < 1e-6);
        assert_eq!(aim(target, |_| false), Some(target));
        assert_eq!(aim(target, |at| at.distance(target) < 0.6), Some(target), "deep inside");
        assert_eq!(aim(DVec2::new(5.0, 0.0), |_| false), None, "off the map");
    }

    #[test]
    fn a_target_whose_neighbours_are_margins_is_approached_by_a_free_cell_within_the_tolerance() {
        let target = DVec2::new(0.5, 0.0);
        let cells = map(|at| (0.01..0.08).contains(&at.distance(target)));
        for (reach_m, off_m) in [(0.15, 0.1), (0.05, 0.0)] {
            let cell = cell_with_a_way_in(&FRAME, &cells, target, reach_m).unwrap();
            let off = FRAME.centre_of(cell).distance(target);
            assert!((off - off_m).abs() < 1e-6, "{off} m within {reach_m} m");
        }
    }
}
