//! ROS maps as known hazards, and a robot's belief as a ROS map.

use std::path::Path;

use common::{
    geometry::Box2,
    grid::{CellState, GridFrame},
    mission::Mission,
};

use crate::{MOST_BOXES, MapError, PlacedMap, ros};

/// Margin around the perimeter beyond which cells are irrelevant, metres.
const BEYOND_M: f64 = 1.0;

const OCCUPIED: u8 = 0;
const UNKNOWN: u8 = 205;
const FREE: u8 = 254;

/// Adds the map's occupied cells to the known shapes, which makes the run independent of the file.
///
/// # Errors
/// The file is not a map, or needs too many boxes.
pub fn with_prior_map(mut mission: Mission) -> Result<Mission, MapError> {
    if let Some(file) = mission.map.take() {
        let boxes = known(&file, &ros::load_occupied(&file)?, &mission.grid_frame())?;
        mission.known.boxes.extend(boxes);
    }
    Ok(mission)
}

/// Returns boxes over exactly the occupied cells in the perimeter `frame`.
fn known(file: &Path, placed: &PlacedMap, frame: &GridFrame) -> Result<Vec<Box2>, MapError> {
    let within = f64::from(frame.cells) * frame.resolution_m / 2.0 + BEYOND_M;
    let map = &placed.map;
    let wanted: Vec<bool> = (0..map.blocked.len())
        .map(|cell| {
            let (col, row) = ((cell % map.cols) as f64, (cell / map.cols) as f64);
            let away = placed.place(col + 0.5, row + 0.5) - frame.centre;
            map.blocked[cell] && away.abs().max_element() <= within
        })
        .collect();
    let boxes: Vec<Box2> = placed.boxes(&wanted, wanted.clone()).take(MOST_BOXES + 1).collect();
    if boxes.len() > MOST_BOXES { Err(MapError::too_many_boxes(file)) } else { Ok(boxes) }
}

/// Writes `cells`, one [`CellState`] byte each, to the YAML `file` and an image beside it.
///
/// Grid hazards extend a surface by the body's reach. The map has only surfaces: cells with only
/// hazard within that reach. A mission from the map then has the same hazards.
pub fn save_believed(
    file: &Path,
    mission: &Mission,
    frame: &GridFrame,
    cells: &[u8],
) -> Result<(), MapError> {
    let side = i64::from(frame.cells);
    let state = |col: i64, row: i64| {
        let is_inside = (0..side).contains(&col) && (0..side).contains(&row);
        is_inside
            .then(|| cells.get((row * side + col) as usize))
            .flatten()
            .map_or(CellState::Perimeter, |byte| CellState::from_byte(*byte))
    };
    // Minus half a cell, because the surface may lie anywhere in its cell.
    let reach = mapper::step::hazard_reach_m(mission) / frame.resolution_m - 0.5;
    let around = (reach + 0.5).ceil() as i64;
    let beyond = |cells: i64| (cells.abs() as f64 - 0.5).max(0.0);
    let disc: Vec<(i64, i64)> = (-around..=around)
        .flat_map(|row| (-around..=around).map(move |col| (col, row)))
        .filter(|&(col, row)| beyond(col).hypot(beyond(row)) <= reach)
        .collect();
    let pixel = |col: i64, row: i64| match state(col, row) {
        CellState::Scanned => FREE,
        CellState::Free | CellState::Perimeter => UNKNOWN,
        its => {
            let is_surface = disc.iter().all(|(x, y)| state(col + x, row + y).is_hazard());
            match (is_surface, its) {
                (true, _) => OCCUPIED,
                (false, CellState::Margin) => FREE,
                (false, _) => UNKNOWN,
            }
        }
    };
    // Row 0 is the lowest of the grid and the highest of an image.
    let pixels: Vec<u8> = (0..side)
        .rev()
        .flat_map(|row| (0..side).map(move |col| (col, row)))
        .map(|(col, row)| pixel(col, row))
        .collect();
    let corner_m = frame.corner().to_array();
    ros::save(file, frame.cells as usize, &pixels, frame.resolution_m, corner_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::grid::Cell;
    use glam::DVec2;

    fn mission(text: &str) -> Mission {
        let text = format!("target = [2, 0]\nperimeter.width_m = 6\n{text}");
        Mission::parse(&text, "m.toml").unwrap()
    }

    fn hazards(mission: &Mission) -> Vec<bool> {
        let mapper = mapper::step::Mapper::new(mission);
        mapper.state().cells.iter().map(|cell| CellState::from_byte(*cell).is_hazard()).collect()
    }

    #[test]
    fn occupied_pixels_become_boxes_where_the_map_says_and_unknown_ones_do_not() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("office.yaml");
        let pixels = [FREE, OCCUPIED, OCCUPIED, FREE, UNKNOWN, OCCUPIED, OCCUPIED, OCCUPIED];
        ros::save(&file, 4, &pixels, 0.5, [-1.0, 1.0]).unwrap();
        let named = mission(&format!("map = '{}'", file.display()));
        let known = with_prior_map(named).unwrap();
        assert_eq!(known.map, None);
        let boxes: Vec<_> = known.known.boxes.iter().map(|it| (it.at, it.size_m)).collect();
        let expected = [
            (DVec2::new(0.0, 1.5), DVec2::new(1.0, 1.0)),
            (DVec2::new(0.75, 1.25), DVec2::new(0.5, 0.5)),
        ];
        assert_eq!(boxes, expected);
    }

    #[test]
    fn a_saved_map_lies_where_its_cells_do() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("believed.yaml");
        let mission = mission("");
        for cells in [60, 61] {
            let frame = GridFrame { cells, ..mission.grid_frame() };
            let cells = vec![0; frame.area()];
            save_believed(&file, &mission, &frame, &cells).unwrap();
            let placed = ros::load_occupied(&file).unwrap();
            // Image rows count from the top.
            let place = placed.place(7.5, f64::from(frame.cells) - 2.5);
            let apart = place - frame.centre_of(Cell { col: 7, row: 2 });
            assert!(apart.length() < 1e-6, "{apart} m apart of {} cells", frame.cells);
        }
    }

    #[test]
    fn a_mission_from_a_saved_map_has_the_hazards_that_were_believed() {
        let text = "known.drum = [{ at = [1.2, 1.0], radius_m = 0.3 }]\nknown.box = [{ at = [0, -1.5], size_m = [1, 0.4] }]";
        let before = mission(text);
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("believed.yaml");
        let frame = before.grid_frame();
        let mapper = mapper::step::Mapper::new(&before);
        save_believed(&file, &before, &frame, &mapper.state().cells).unwrap();
        let after = with_prior_map(mission(&format!("map = '{}'", file.display()))).unwrap();
        let (before, after) = (hazards(&before), hazards(&after));
        let lost = before.iter().zip(&after).filter(|(was, is)| **was && !**is).count();
        let gained = before.iter().zip(&after).filter(|(was, is)| !**was && **is).count();
        assert_eq!(lost, 0, "{gained} gained");
        assert!(gained * 10 < before.iter().filter(|it| **it).count(), "{gained} gained");
    }
}
