use std::path::Path;

use common::grid::CellState;
use harmonic::{Cancellation, Domain, Field, Solver};

use super::*;
use crate::view::field_cell;

/// Inflation of hazards: half the width and the mapper's margin.
const INFLATED_M: f64 = 0.2 + 0.055;

/// Robot of 0.9 by 0.4 m with a laser, in a square of 4 m with the target 1.5 m ahead along x.
fn long() -> (Mission, Outline) {
    let text = "target = [1.5, 0]\nrobot.model = 'jackal'\n\
         robot.footprint = [[-0.45, -0.2], [0.45, -0.2], [0.45, 0.2], [-0.45, 0.2]]\n\
         perimeter = { width_m = 4, cells = 80 }";
    let mission = Mission::parse(text, Path::new("m.toml")).unwrap();
    let outline = Outline::new(&mission, &mission.outline().unwrap());
    (mission, outline)
}

fn room(mission: &Mission, clearance: impl Fn(DVec2) -> f64) -> (Vec<u8>, Field) {
    let frame = mission.grid_frame();
    let state = |cell: Cell| match frame.is_rim(cell) {
        true => CellState::Perimeter,
        false if clearance(frame.centre_of(cell)) <= INFLATED_M => CellState::Margin,
        false => CellState::Scanned,
    };
    let cells: Vec<u8> = frame.whole().cells().map(|cell| state(cell) as u8).collect();
    let blocked = cells.iter().map(|&cell| CellState::from_byte(cell).is_hazard());
    let target = field_cell(frame.cell_at(mission.target).unwrap());
    let domain = Domain::new(80, 80, blocked.collect(), target).unwrap();
    let field = Solver::default().solve(&domain, &Cancellation::default()).unwrap();
    (cells, field)
}

fn view<'a>(mission: &Mission, (cells, field): &'a (Vec<u8>, Field)) -> View<'a> {
    View { frame: mission.grid_frame(), cells, field, refused: &[] }
}

fn pose(x: f64, y: f64, heading_deg: f64) -> Pose2 {
    Pose2 { position: DVec2::new(x, y), heading: heading_deg.to_radians() }
}

#[test]
fn an_outline_touches_what_is_nearer_than_the_margin_and_nothing_else() {
    let (mission, outline) = long();
    let footprint = mission.outline().unwrap();
    let mut touched = 0;
    for n in 0..400 {
        let n = f64::from(n);
        let at = pose(0.5 * (n * 0.7).sin(), 0.5 * (n * 1.3).cos(), n * 37.0);
        let post = DVec2::new(0.4 * (n * 0.31).sin(), 0.4 * (n * 0.17).cos());
        let map = room(&mission, |place| place.distance(post));
        let local = DVec2::from_angle(-at.heading).rotate(post - at.position);
        let (gap_m, _) = footprint.gap_to_point(local);
        let touches = outline.touches(&view(&mission, &map), &at);
        // A post inside the body was on its outline before.
        if gap_m.abs() < 0.04 {
            assert!(touches, "{gap_m} m");
            touched += 1;
        }
        assert!(!touches || gap_m < 0.11, "{gap_m} m");
    }
    assert!(touched > 20, "{touched}");
}

#[test]
fn a_long_body_turns_in_the_open_and_not_between_walls() {
    let (mission, outline) = long();
    let map = room(&mission, |at| (at.y.abs() - 0.35).abs());
    let between = view(&mission, &map);
    let along = pose(-1.0, 0.0, 0.0);
    assert!(!outline.touches(&between, &along));
    assert!(outline.touches(&between, &pose(-1.0, 0.0, 90.0)));
    assert!(outline.turns(&between, &along, 0.1) && !outline.turns(&between, &along, PI));
    let empty = room(&mission, |_| f64::INFINITY);
    assert!(outline.turns(&view(&mission, &empty), &along, PI));
}
