//! What a belief that was broken on purpose holds for hazard.

use common::samples::FaultKind;
use glam::DVec2;

/// How far around the robot hazard is believed by the fault that puts it inside, metres.
const AROUND_M: f64 = 0.5;
/// From the target to the wall that cuts it off, metres.
const WALL_M: f64 = 0.5;
/// The wall's thickness in cells: no step to a neighbour crosses it.
const WALL_CELLS: f64 = 1.5;

/// Ground that is believed hazardous without a reason.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Area {
    /// All of it within [`AROUND_M`] of this point.
    Disc(DVec2),
    /// A wall at [`WALL_M`] from this point.
    Wall(DVec2),
}

impl Area {
    /// Whether a cell of that side, with its middle at `at`, is of it; metres.
    pub(crate) fn covers(self, at: DVec2, side: f64) -> bool {
        match self {
            Self::Disc(middle) => at.distance(middle) <= AROUND_M,
            Self::Wall(middle) => {
                (WALL_M..WALL_M + WALL_CELLS * side).contains(&at.distance(middle))
            }
        }
    }
}

/// What `fault` makes hazard, of a robot at `robot` on its way to `target`; none if it makes none.
pub(crate) fn hazard(fault: FaultKind, robot: DVec2, target: DVec2) -> Option<Area> {
    match fault {
        FaultKind::HazardAroundRobot => Some(Area::Disc(robot)),
        FaultKind::CutOff => Some(Area::Wall(target)),
        _ => None,
    }
}

/// What is left of `fault` in a belief that forgot what was sensed.
pub(crate) fn after_reset(fault: FaultKind) -> FaultKind {
    match fault {
        FaultKind::CutOff => fault,
        _ => FaultKind::Nothing,
    }
}
