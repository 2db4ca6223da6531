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
fn the_screening_length_is_the_same_on_any_grid() {
    // u falls by exp(-1) in a length of lambda: 1 + 2 k = cosh(delta / lambda), nearly.
    for cells in [200, 1000] {
        let delta = 10.0 / f64::from(cells);
        let decay = (1.0 + 2.0 * with_cells(cells).screening()).acosh() / delta;
        assert!((decay * 0.5 - 1.0).abs() < 1e-3, "{decay} a metre");
    }
    assert_eq!(
        Mission::parse("target = [1, 0]\nmethod = 'paper'", Path::new("test.toml"))
            .unwrap()
            .screening(),
        0.0
    );
}
