use super::*;
use crate::{
    step::tests::{in_scanned_room, keyframe},
    testing::mission,
};

/// Inflation of hazards: half the width and the mapper's margin.
const INFLATED_M: f64 = 0.2 + 0.055;

/// Robot of 0.9 by 0.4 m with a laser, in a square of 4 m with the target 1.5 m ahead along x.
fn long() -> (Mission, Outline) {
    let text = "target = [1.5, 0]\nrobot.model = 'jackal'\n\
         robot.footprint = [[-0.45, -0.2], [0.45, -0.2], [0.45, 0.2], [-0.45, 0.2]]\n\
         perimeter = { width_m = 4, cells = 80 }";
    let mission = mission(text);
    let outline = Outline::new(&mission, &mission.outline().unwrap());
    (mission, outline)
}

fn pose(x: f64, y: f64, heading_deg: f64) -> Pose2 {
    Pose2 { position: DVec2::new(x, y), heading: heading_deg.to_radians() }
}

#[test]
fn an_outline_touches_what_is_nearer_than_the_margin_and_nothing_else() {
    let (mission, outline) = long();
    let footprint = mission.outline().unwrap();
    let open = in_scanned_room(&mission, |_| false, |_| true);
    let mut touched = 0;
    for n in 0..400 {
        let n = f64::from(n);
        let at = pose(0.5 * (n * 0.7).sin(), 0.5 * (n * 1.3).cos(), n * 37.0);
        let post = DVec2::new(0.4 * (n * 0.31).sin(), 0.4 * (n * 0.17).cos());
        let (_, cells) = keyframe(&mission, |place| place.distance(post) <= INFLATED_M, |_| true);
        let local = DVec2::from_angle(-at.heading).rotate(post - at.position);
        let (gap_m, _) = footprint.gap_to_point(local);
        let touches = outline.touches(&View { cells: &cells, ..open.view() }, &at);
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
    let walls = in_scanned_room(&mission, |at| (at.y.abs() - 0.35).abs() <= INFLATED_M, |_| true);
    let between = walls.view();
    let along = pose(-1.0, 0.0, 0.0);
    assert!(outline.turns(&between, &along, 0.1) && !outline.turns(&between, &along, PI));
    let empty = in_scanned_room(&mission, |_| false, |_| true);
    assert!(outline.turns(&empty.view(), &along, PI));
}
