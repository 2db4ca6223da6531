use super::*;
use crate::baselines::{
    planner::Baseline,
    testing::{drawn, pose, sent},
};
use common::samples::GuidanceStatus;

const WALL: [&str; 9] = [
    ".........",
    ".........",
    "....#....",
    "....#....",
    "....#....",
    "....#....",
    "....#....",
    "....#....",
    "....#....",
];

fn planner(rows: &[&str]) -> Baseline {
    let mut planner = sent([0.3, 0.0]);
    let (header, cells) = drawn(rows);
    assert!(planner.belief.follow(&header, &cells));
    planner
}

#[test]
fn the_way_leads_around_a_wall_and_cuts_no_corner() {
    let mut at = DVec2::new(-0.3, 0.0);
    let planner = planner(&WALL);
    let mut driven = 0.0;
    while at.distance(DVec2::new(0.3, 0.0)) > 0.03 {
        let guidance = planner.guidance(&pose(at.into()));
        assert_eq!(guidance.status, u8::from(GuidanceStatus::Along), "at {at}, after {driven} m");
        at += 0.02 * DVec2::new(guidance.ex, guidance.ey);
        driven += 0.02;
        assert!(planner.belief.map().unwrap().free_cell_at(at).is_some(), "in the wall at {at}");
        assert!(driven < 2.0, "it does not end, at {at}");
    }
    // The path rounds the wall's end in two legs of 0.3 m by 0.3 m, 0.85 m in all; whole cells
    // lengthen it.
    assert!((0.8..1.1).contains(&driven), "{driven}");
}

#[test]
fn a_target_behind_a_closed_wall_or_inside_hazard_is_unreachable() {
    let closed = ["....#...."; 9];
    let mut on_target = ["........."; 9];
    on_target[4] = ".......#.";
    for rows in [closed, on_target] {
        let status = planner(&rows).guidance(&pose([-0.3, 0.0])).status;
        assert_eq!(status, u8::from(GuidanceStatus::Unreachable));
    }
}

#[test]
fn a_robot_inside_hazard_leaves_by_the_nearest_free_cell() {
    let guidance = planner(&WALL).guidance(&pose([0.02, 0.15]));
    assert_eq!(guidance.status, u8::from(GuidanceStatus::WayOut));
    assert!(guidance.ex.abs() > 0.8, "{guidance:?}");
    assert!(guidance.speed_limit_m_s < 0.1);
}
