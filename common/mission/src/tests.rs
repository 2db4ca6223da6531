use std::path::Path;

use super::*;

fn with_cells(cells: u32) -> Mission {
    let text = format!(
        "target = [1, 0]\nperimeter = {{ width_m = 10, cells = {cells} }}\n\
         mapper = {{ margin_m = 0.25 }}\nplanner = {{ screening_m = 0.5 }}"
    );
    Mission::parse(&text, Path::new("test.toml")).unwrap()
}

#[test]
fn a_margin_in_metres_is_covered_on_any_grid_and_by_no_cell_more() {
    for (cells, margin) in [(10, 0), (100, 2), (200, 5), (1000, 25)] {
        assert_eq!(with_cells(cells).margin_cells(), margin, "{cells} cells");
    }
}

#[test]
fn the_papers_method_has_no_screening_unless_the_mission_says_so() {
    let paper = "target = [1, 0]\nmethod = 'paper'";
    let parse = |text: &str| Mission::parse(text, Path::new("test.toml")).unwrap();
    assert_eq!(parse(paper).screening_length_m(), None);
    let screened = format!("{paper}\nplanner = {{ screening_m = 0.5 }}");
    assert_eq!(parse(&screened).screening_length_m(), Some(0.5));
    assert_eq!(
        parse("target = [1, 0]").screening_length_m(),
        Some(Planner::EVIDENTIAL_SCREENING_M)
    );
}

#[test]
fn the_sets_of_sensors_have_these_names_and_no_others() {
    let parse = |text: &str| Mission::parse(text, Path::new("test.toml"));
    for (name, set) in [
        ("front", Sensors::Front),
        ("front+infrared", Sensors::FrontInfrared),
        ("three-front", Sensors::ThreeFront),
        ("all", Sensors::All),
    ] {
        let mission = parse(&format!("target = [1, 0]\nsensors = '{name}'")).unwrap();
        assert_eq!(mission.sensor_set(), set);
    }
    let error = parse("target = [1, 0]\nsensors = 'infrared'").unwrap_err();
    assert!(error.to_string().contains("front+infrared"), "{error}");
}

#[test]
fn the_papers_method_with_infrared_is_refused_with_line_and_remedy() {
    let text = "target = [1, 0]\nmethod = 'paper'\nsensors = 'front+infrared'";
    let error = Mission::parse(text, Path::new("test.toml")).unwrap_err();
    let error = error.to_string();
    assert!(error.starts_with("test.toml:3: sensors: "), "{error}");
    assert!(error.contains("evidential"), "{error}");
}
