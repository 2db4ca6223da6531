//! Hazards of injected faults.

use common::samples::FaultKind;
use glam::DVec2;

const AROUND_M: f64 = 0.5;
/// Radius of the wall around the target.
const WALL_M: f64 = 0.5;
/// Thickness of the wall, which no step to a neighbouring cell crosses.
const WALL_CELLS: f64 = 1.5;

/// Returns whether a cell of `side` metres at `at` is a hazard of `fault`.
pub(crate) fn covers(fault: FaultKind, at: DVec2, side: f64, robot: DVec2, target: DVec2) -> bool {
    match fault {
        FaultKind::HazardAroundRobot => at.distance(robot) <= AROUND_M,
        FaultKind::CutOff => (WALL_M..WALL_M + WALL_CELLS * side).contains(&at.distance(target)),
        _ => false,
    }
}

/// Returns the fault that outlasts a reset of the belief.
pub(crate) fn after_reset(fault: FaultKind) -> FaultKind {
    match fault {
        FaultKind::CutOff => fault,
        _ => FaultKind::Nothing,
    }
}
