//! What a belief that was broken on purpose holds for hazard.

use common::samples::FaultKind;
use glam::DVec2;

/// How far around the robot a belief that buries it is wrong, metres.
const BURIED_M: f64 = 0.5;
/// From the target to the wall that cuts it off, metres.
const WALL_M: f64 = 0.5;
/// The wall's thickness in cells: no step to a neighbour crosses it.
const WALL_CELLS: f64 = 1.5;

/// Ground that is believed hazardous without a reason.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Area {
    /// All of it within [`BURIED_M`] of this point.
    Disc(DVec2),
    /// A wall at [`WALL_M`] from this point.
    Wall(DVec2),
}

impl Area {
    /// Whether a cell of that side, with its middle at `at`, is of it; metres.
    pub(crate) fn covers(self, at: DVec2, side: f64) -> bool {
        match self {
            Self::Disc(middle) => at.distance(middle) <= BURIED_M,
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
pub(crate) fn after_forgetting(fault: FaultKind) -> FaultKind {
    match fault {
        FaultKind::CutOff => fault,
        _ => FaultKind::Nothing,
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use common::{
        grid::{Cell, CellState},
        mission::Mission,
        samples::{PoseSample, Stamp},
    };

    use super::*;
    use crate::step::Mapper;

    fn mapper(method: &str) -> Mapper {
        let text = format!(
            "target = [1.5, 0]\nmethod = '{method}'\nperimeter = {{ width_m = 5, cells = 50 }}"
        );
        Mapper::new(&Mission::parse(&text, Path::new("test.toml")).unwrap())
    }

    fn stand(mapper: &mut Mapper, tick: u64, x_m: f64) {
        let stamp = Stamp {
            tick,
            ..Stamp::default()
        };
        mapper.step(
            &PoseSample {
                stamp,
                x_m,
                ..PoseSample::default()
            },
            None,
        );
    }

    fn is_hazard(mapper: &Mapper, x: f64, y: f64) -> bool {
        let cell = mapper.frame().cell_at(DVec2::new(x, y)).unwrap();
        CellState::from_byte(mapper.belief().cells()[mapper.frame().index(cell)]).is_hazard()
    }

    /// Whether the free cells lead from the origin to the target's.
    fn is_connected(mapper: &Mapper) -> bool {
        let frame = mapper.frame();
        let free = |cell: Cell| {
            !CellState::from_byte(mapper.belief().cells()[frame.index(cell)]).is_hazard()
        };
        let mut seen = vec![false; frame.area()];
        let mut next = vec![frame.cell_at(DVec2::ZERO).unwrap()];
        while let Some(Cell { col, row }) = next.pop() {
            let beside = [
                (col - 1, row),
                (col + 1, row),
                (col, row - 1),
                (col, row + 1),
            ];
            for (col, row) in beside {
                let cell = Cell { col, row };
                if free(cell) && !std::mem::replace(&mut seen[frame.index(cell)], true) {
                    next.push(cell);
                }
            }
        }
        seen[frame.index(frame.cell_at(DVec2::new(1.5, 0.0)).unwrap())]
    }

    #[test]
    fn a_buried_robot_takes_its_hazard_along_until_the_belief_is_forgotten() {
        for method in ["paper", "careful"] {
            let mut mapper = mapper(method);
            mapper.inject(FaultKind::HazardAroundRobot);
            stand(&mut mapper, 0, 0.0);
            assert!(is_hazard(&mapper, 0.0, 0.0) && !is_hazard(&mapper, 0.7, 0.0));
            stand(&mut mapper, 1, 0.3);
            assert!(is_hazard(&mapper, 0.7, 0.0));
            assert!(mapper.forget(1));
            assert!(!is_hazard(&mapper, 0.3, 0.0) && !is_hazard(&mapper, 0.7, 0.0));
            stand(&mut mapper, 2, 0.3);
            assert!(!is_hazard(&mapper, 0.3, 0.0), "{method}");
        }
    }

    #[test]
    fn a_target_that_is_cut_off_stays_so_whatever_is_forgotten() {
        for method in ["paper", "careful"] {
            let mut mapper = mapper(method);
            assert!(is_connected(&mapper));
            mapper.inject(FaultKind::CutOff);
            stand(&mut mapper, 0, 0.0);
            assert!(!is_connected(&mapper));
            assert!(mapper.forget(1));
            assert!(!is_connected(&mapper), "{method}");
        }
    }

    #[test]
    fn a_version_differs_from_the_one_before_in_one_window_broken_or_not() {
        let mut mapper = mapper("careful");
        mapper.inject(FaultKind::HazardAroundRobot);
        for tick in 0..4 {
            let before = (mapper.belief().version(), mapper.belief().cells().to_vec());
            stand(&mut mapper, tick, 0.1 * tick as f64);
            assert_eq!(mapper.belief().version(), before.0 + 1);
            assert_ne!(mapper.belief().cells(), before.1);
        }
    }
}
