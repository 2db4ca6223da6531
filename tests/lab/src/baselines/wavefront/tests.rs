use super::*;
use crate::baselines::planner::Baseline;
use common::{
    grid::{CellState, GridFrame, Part, Replica},
    mission::Mission,
    samples::{GridHeader, GuidanceSample, GuidanceStatus, PoseSample, TargetSample},
};

const WALL: &str = "\
.........
.........
....#....
....#....
....#....
....#....
....#....
....#....
....#....
";

/// Returns a planner to (0.3, 0.0) that knows a drawn map: `#` is hazard, the first row has the
/// greatest y. Cells are 0.1 m wide, the middle one at (0, 0).
fn planner(map: &str) -> Baseline {
    let mission = Mission::parse("target = [0.3, 0.0]", "test.toml").unwrap();
    let mut planner = Baseline::new(&mission);
    planner.target = Some(TargetSample::first(&mission));
    let frame = GridFrame { cells: 9, resolution_m: 0.1, centre: DVec2::ZERO };
    let header = GridHeader { part: Part::whole(frame, 1), ..GridHeader::default() };
    let letters = map.lines().rev().flat_map(str::bytes);
    let cells = letters.map(|letter| match letter {
        b'#' => CellState::Sensed as u8,
        _ => CellState::Free as u8,
    });
    assert!(planner.follow(&header, &cells.collect::<Vec<_>>()));
    planner
}

fn guidance(planner: &Baseline, [x_m, y_m]: [f64; 2]) -> GuidanceSample {
    planner.guidance(&PoseSample { x_m, y_m, ..PoseSample::default() })
}

#[test]
fn without_a_map_the_robot_waits() {
    let mut planner = planner(WALL);
    planner.grid = Replica::default();
    let status = guidance(&planner, [0.0, 0.0]).status;
    assert_eq!(status, u8::from(GuidanceStatus::Waiting));
}

#[test]
fn the_way_leads_around_a_wall_and_cuts_no_corner() {
    let mut at = DVec2::new(-0.3, 0.0);
    let planner = planner(WALL);
    let mut driven = 0.0;
    while at.distance(DVec2::new(0.3, 0.0)) > 0.03 {
        let guidance = guidance(&planner, at.into());
        assert_eq!(guidance.status, u8::from(GuidanceStatus::Along), "at {at}, after {driven} m");
        at += 0.02 * DVec2::new(guidance.ex, guidance.ey);
        driven += 0.02;
        assert!(Map::of(&planner.grid).unwrap().free_cell_at(at).is_some(), "in the wall at {at}");
        assert!(driven < 2.0, "it does not end, at {at}");
    }
    // The path rounds the wall's end in two legs of 0.3 m by 0.3 m, 0.85 m in all; whole cells
    // lengthen it.
    assert!((0.8..1.1).contains(&driven), "{driven}");
}

#[test]
fn a_target_behind_a_closed_wall_or_inside_hazard_is_unreachable() {
    let free = ".........\n".repeat(4);
    for map in ["....#....\n".repeat(9), format!("{free}.......#.\n{free}")] {
        let status = guidance(&planner(&map), [-0.3, 0.0]).status;
        assert_eq!(status, u8::from(GuidanceStatus::Unreachable));
    }
}

#[test]
fn a_robot_inside_hazard_leaves_by_the_nearest_free_cell() {
    let guidance = guidance(&planner(WALL), [0.02, 0.15]);
    assert_eq!(guidance.status, u8::from(GuidanceStatus::WayOut));
    assert!(guidance.ex.abs() > 0.8, "{guidance:?}");
    assert!(guidance.speed_limit_m_s < 0.1);
}
