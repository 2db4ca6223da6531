//! Hazards of injected faults.

use common::samples::FaultKind;
use glam::DVec2;

const AROUND_M: f64 = 0.5;
const WALL_M: f64 = 0.5;
/// No step to a neighbouring cell crosses it.
const WALL_CELLS: f64 = 1.5;

pub(crate) fn covers(fault: FaultKind, at: DVec2, side: f64, robot: DVec2, target: DVec2) -> bool {
    match fault {
        FaultKind::HazardAroundRobot => at.distance(robot) <= AROUND_M,
        FaultKind::CutOff => (WALL_M..WALL_M + WALL_CELLS * side).contains(&at.distance(target)),
        _ => false,
    }
}
