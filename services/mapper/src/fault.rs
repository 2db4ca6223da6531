//! Hazards of injected faults.

use common::samples::FaultKind;
use glam::DVec2;

const AROUND_M: f64 = 0.5;
/// Radius of the wall around the target.
const WALL_M: f64 = 0.5;
/// Thickness of the wall, which no step to a neighbouring cell crosses.
const WALL_CELLS: f64 = 1.5;

#[derive(Clone, Copy)]
pub(crate) enum Area {
    Disc(DVec2),
    /// Ring of radius [`WALL_M`].
    Wall(DVec2),
}

impl Area {
    pub(crate) fn covers(self, at: DVec2, side: f64) -> bool {
        match self {
            Self::Disc(middle) => at.distance(middle) <= AROUND_M,
            Self::Wall(middle) => {
                (WALL_M..WALL_M + WALL_CELLS * side).contains(&at.distance(middle))
            }
        }
    }
}

pub(crate) fn hazard(fault: FaultKind, robot: DVec2, target: DVec2) -> Option<Area> {
    match fault {
        FaultKind::HazardAroundRobot => Some(Area::Disc(robot)),
        FaultKind::CutOff => Some(Area::Wall(target)),
        _ => None,
    }
}

/// Returns the fault that outlasts a reset of the belief.
pub(crate) fn after_reset(fault: FaultKind) -> FaultKind {
    match fault {
        FaultKind::CutOff => fault,
        _ => FaultKind::Nothing,
    }
}
