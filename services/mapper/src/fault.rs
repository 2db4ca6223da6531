//! The hazard of an injected fault.

use common::samples::FaultKind;
use glam::DVec2;

/// Around the robot, metres.
const AROUND_M: f64 = 0.5;
/// Distance of the wall that encloses the target, metres.
const WALL_M: f64 = 0.5;
/// No step to a neighbouring cell crosses the wall.
const WALL_CELLS: f64 = 1.5;

#[derive(Clone, Copy)]
pub(crate) enum Area {
    Disc(DVec2),
    /// Its distance from this point is [`WALL_M`].
    Wall(DVec2),
}

impl Area {
    /// Whether it covers a cell of width `side`, centred at `at`, metres.
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

/// A fault may outlast a reset of the sensed belief.
pub(crate) fn after_reset(fault: FaultKind) -> FaultKind {
    match fault {
        FaultKind::CutOff => fault,
        _ => FaultKind::Nothing,
    }
}
