use std::path::Path;

use common::grid::{Cell, CellState};
use harmonic::{Cancellation, Domain, Solver};

use super::*;
use crate::view::field_cell;

/// Returns speed limit and turn (positive to the left) of a car at the origin; the target is 1.5 m
/// ahead along x.
fn advice(heading: f64, hazard: impl Fn(DVec2) -> bool) -> (f64, f64) {
    let text = "target = [1.5, 0]\nrobot.model = 'car'\nperimeter = { width_m = 4, cells = 80 }";
    let mission = Mission::parse(text, Path::new("m.toml")).unwrap();
    let frame = mission.grid_frame();
    let state = |cell: Cell| match frame.is_rim(cell) {
        true => CellState::Perimeter,
        false if hazard(frame.centre_of(cell)) => CellState::Known,
        false => CellState::Free,
    };
    let cells: Vec<u8> = frame.whole().cells().map(|cell| state(cell) as u8).collect();
    let blocked = cells.iter().map(|&cell| CellState::from_byte(cell).is_hazard());
    let target = frame.cell_at(mission.target).unwrap();
    let domain = Domain::new(80, 80, blocked.collect(), field_cell(target)).unwrap();
    let field = Solver::default().solve(&domain, &Cancellation::default()).unwrap();
    let view = View { frame, cells: &cells, field: &field, refused: &[] };
    let pose = Pose2 { heading, ..Pose2::default() };
    let (direction, limit) = Arcs::new(&mission).unwrap().advise(&view, &pose, 1.5);
    (limit, pose.axis().perp_dot(direction))
}

#[test]
fn a_car_drives_straight_to_a_target_ahead_and_turns_to_one_at_its_side() {
    let (limit, turn) = advice(0.0, |_| false);
    assert!(limit > 1.0 && turn == 0.0, "{limit} m/s, {turn}");
    let (_, turn) = advice(1.5, |_| false);
    assert!(turn < -0.1, "the target lies to the right: {turn}");
}

#[test]
fn an_arc_that_a_hazard_cuts_off_is_not_driven() {
    // The hazard extends from y = -0.2 to 0.9, so the car passes on the right.
    let (limit, turn) = advice(0.0, |at| (at.x - 0.5).abs() < 0.1 && at.y > -0.2 && at.y < 0.9);
    assert!(limit > 0.0 && turn < 0.0, "{limit} m/s, {turn}");
}

#[test]
fn a_car_that_cannot_steer_clear_of_a_wall_stands_although_there_is_a_way_behind_it() {
    let (limit, _) = advice(0.0, |at| at.x > 0.05 && at.x < 0.3 && at.y.abs() < 1.0);
    assert_eq!(limit, 0.0);
    let x80 = Mission::parse("target = [1.5, 0]", Path::new("m.toml")).unwrap();
    assert!(Arcs::new(&x80).is_none());
}
