//! Hazard that an injected fault puts into the belief.

use common::samples::FaultKind;
use glam::DVec2;

/// Radius of the hazard around the robot, metres.
const AROUND_M: f64 = 0.5;
/// Distance from the target to the wall that encloses it, metres.
const WALL_M: f64 = 0.5;
/// Thickness of the wall, cells: no step to a neighbouring cell crosses it.
const WALL_CELLS: f64 = 1.5;

/// An area that a fault makes hazard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Area {
    /// The disc of [`AROUND_M`] around this point.
    Disc(DVec2),
    /// The closed wall at [`WALL_M`] from this point.
    Wall(DVec2),
}

impl Area {
    /// Whether the area covers a cell of width `side` with its centre at `at`, metres.
    pub(crate) fn covers(self, at: DVec2, side: f64) -> bool {
        match self {
            Self::Disc(middle) => at.distance(middle) <= AROUND_M,
            Self::Wall(middle) => {
                (WALL_M..WALL_M + WALL_CELLS * side).contains(&at.distance(middle))
            }
        }
    }
}

/// The area that `fault` makes hazard for a robot at `robot` on its way to `target`.
pub(crate) fn hazard(fault: FaultKind, robot: DVec2, target: DVec2) -> Option<Area> {
    match fault {
        FaultKind::HazardAroundRobot => Some(Area::Disc(robot)),
        FaultKind::CutOff => Some(Area::Wall(target)),
        _ => None,
    }
}

/// The part of `fault` that is left after a reset of the sensed belief.
pub(crate) fn after_reset(fault: FaultKind) -> FaultKind {
    match fault {
        FaultKind::CutOff => fault,
        _ => FaultKind::Nothing,
    }
}
