use super::*;
use crate::testing::mission;

#[test]
fn a_margin_in_metres_is_covered_on_any_grid_and_by_no_cell_more() {
    for (cells, margin) in [(10, 0), (100, 2), (200, 5), (1000, 25)] {
        let perimeter = format!("perimeter = {{ width_m = 10, cells = {cells} }}");
        let mission = mission(&format!("{perimeter}\nmapper.margin_m = 0.25"));
        assert_eq!(mission.margin_cells(), margin, "{cells} cells");
    }
}

#[test]
fn the_papers_method_has_no_screening_unless_the_mission_says_so() {
    for (text, length_m) in [
        ("method = 'paper'", None),
        ("method = 'paper'\nplanner.screening_m = 0.5", Some(0.5)),
        ("", Some(Planner::EVIDENTIAL_SCREENING_M)),
    ] {
        assert_eq!(mission(text).screening_length_m(), length_m, "{text}");
    }
}
