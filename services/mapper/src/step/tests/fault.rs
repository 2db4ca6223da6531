//! Tests of a belief with an injected fault.

use super::*;

fn mapper(method: &str) -> Mapper {
    mapper_of(&format!(
        "target = [1.5, 0]\nmethod = '{method}'\nperimeter = {{ width_m = 5, cells = 50 }}"
    ))
}

fn stand(mapper: &mut Mapper, tick: u64, x_m: f64) {
    mapper.sense(at(tick, x_m, 0.0, 0.0), &[]);
}

fn is_connected(mapper: &Mapper) -> bool {
    let frame = mapper.frame();
    let mut seen = vec![false; frame.area()];
    let mut next = vec![frame.cell_at(DVec2::ZERO).unwrap()];
    while let Some(cell) = next.pop() {
        let at = frame.index(cell);
        let is_free = !CellState::from_byte(mapper.state().cells[at]).is_hazard();
        if is_free && !std::mem::replace(&mut seen[at], true) {
            let Cell { col, row } = cell;
            let beside = [(col - 1, row), (col + 1, row), (col, row - 1), (col, row + 1)];
            next.extend(beside.map(|(col, row)| Cell { col, row }));
        }
    }
    seen[frame.index(frame.cell_at(DVec2::new(1.5, 0.0)).unwrap())]
}

#[test]
fn a_robot_inside_a_false_hazard_takes_it_along_until_the_belief_is_forgotten() {
    for method in ["paper", "evidential"] {
        let mut mapper = mapper(method);
        mapper.step(Input::Fault(FaultKind::HazardAroundRobot), MissionTime(0));
        stand(&mut mapper, 0, 0.0);
        assert!(mapper.hazard_ahead(0) && !mapper.hazard_ahead(70));
        stand(&mut mapper, 1, 0.3);
        assert!(mapper.hazard_ahead(70));
        assert!(mapper.reset(1));
        assert!(!mapper.hazard_ahead(30) && !mapper.hazard_ahead(70));
        stand(&mut mapper, 2, 0.3);
        assert!(!mapper.hazard_ahead(30), "{method}");
    }
}

#[test]
fn a_target_that_is_cut_off_stays_so_whatever_is_forgotten() {
    for method in ["paper", "evidential"] {
        let mut mapper = mapper(method);
        assert!(is_connected(&mapper));
        mapper.step(Input::Fault(FaultKind::CutOff), MissionTime(0));
        stand(&mut mapper, 0, 0.0);
        assert!(!is_connected(&mapper));
        assert!(mapper.reset(1));
        assert!(!is_connected(&mapper), "{method}");
    }
}

#[test]
fn a_version_differs_from_the_one_before_in_one_window_broken_or_not() {
    let mut mapper = mapper("evidential");
    mapper.step(Input::Fault(FaultKind::HazardAroundRobot), MissionTime(0));
    for tick in 0..4 {
        let before = (mapper.state().version, mapper.state().cells.to_vec());
        stand(&mut mapper, tick, 0.1 * tick as f64);
        assert_eq!(mapper.state().version, before.0 + 1);
        assert_ne!(mapper.state().cells, before.1);
    }
}
