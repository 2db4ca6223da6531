//! The laser model: the meaning of a scan for the cells along its beams.
//!
//! A beam is thinner than a cell and ends at a surface of any angle, so the cells that it passed are free and the cell in which it ends
//! is occupied. Glass and black surfaces may give no reading: the cells before them stay what they were, and what a sonar heard there
//! is believed until a beam passes through it.
//!
//! Many beams cross one cell near the laser, so a scan counts once for each cell. Where a fifth of them end and the others pass, the cell
//! is occupied: a post, or the edge of a thing, fills a part of its cell. Fewer that end there are noise of a surface behind it, which
//! must not close a gap.

use common::grid::{Cell, GridFrame, Window};
use glam::{DVec2, IVec2};

use crate::{
    evidence_grid::{EvidenceGrid, Flip},
    reading::Fan,
    sonar_model::SonarModel,
};

/// Weight of a cell in which beams end. One scan makes a free cell occupied.
const HIT: i8 = 6;
/// Weight taken off a cell that beams passed and in which none ended. Two scans free a cell that many others filled.
const PASS: i8 = 6;

/// A beam that passes a cell and ends no farther behind it is no evidence against a thing in it: along a wall at a slant most beams pass
/// a part of it before they end in the next one, metres.
const NEAR_END_M: f64 = 0.25;
/// No robot is farther from its map, cells.
const FARTHEST: f64 = 1e6;

/// A cell is occupied if of so many beams that pass at least one ends.
const PASS_FOR_ONE_THAT_ENDS: u8 = 4;

/// The beams of a scan in a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Beams {
    passed: u8,
    ended: u8,
    /// Whether one of those that passed ends far behind.
    passed_far: bool,
}

impl Beams {
    const ENDED: Self = Self { passed: 0, ended: 1, passed_far: false };

    const fn passed(far: bool) -> Self {
        Self { passed: 1, ended: 0, passed_far: far }
    }

    const fn and(self, other: Self) -> Self {
        Self {
            passed: self.passed.saturating_add(other.passed),
            ended: self.ended.saturating_add(other.ended),
            passed_far: self.passed_far || other.passed_far,
        }
    }

    const fn are_of_a_thing(self) -> bool {
        self.ended > 0 && self.ended.saturating_mul(PASS_FOR_ONE_THAT_ENDS) >= self.passed
    }
}

/// Cells of the lattice along a beam, each once, in order: the grid's lines that it crosses tell which.
struct Along {
    cell: IVec2,
    step: IVec2,
    /// Ranges at which the next line of a column and of a row is crossed, and from line to line, in cells.
    next: DVec2,
    each: DVec2,
}

impl Along {
    /// From `origin`, in cells of the lattice, in the unit direction `along`.
    fn new(origin: DVec2, along: DVec2) -> Self {
        // The centre of a cell has whole coordinates.
        let cell = (origin + 0.5).floor();
        let ahead = |origin: f64, cell: f64, along: f64| {
            let line = if along > 0.0 { cell + 0.5 } else { cell - 0.5 };
            if along == 0.0 { f64::INFINITY } else { (line - origin) / along }
        };
        Self {
            cell: cell.as_ivec2(),
            step: along.signum().as_ivec2(),
            next: DVec2::new(ahead(origin.x, cell.x, along.x), ahead(origin.y, cell.y, along.y)),
            each: along.abs().recip(),
        }
    }

    /// The range at which the present cell ends, in cells.
    fn ends(&self) -> f64 {
        self.next.min_element()
    }

    fn advance(&mut self) {
        if self.next.x <= self.next.y {
            self.cell.x += self.step.x;
            self.next.x += self.each.x;
        } else {
            self.cell.y += self.step.y;
            self.next.y += self.each.y;
        }
    }
}

impl EvidenceGrid {
    /// Take a scan of a laser on a robot at `robot` with a body of `radius` metres. Appends the cells that flipped to `flips` and returns
    /// the window of all cells that changed.
    pub(crate) fn take_scan(
        &mut self,
        sonar: &SonarModel,
        lattice: &GridFrame,
        fan: &Fan<'_>,
        (robot, radius): (DVec2, f64),
        flips: &mut Vec<Flip>,
    ) -> Window {
        let mut results = vec![Beams::default(); lattice.area()];
        let mut touched = Vec::new();
        let side = lattice.cells as i32;
        let origin = lattice.to_cells(fan.origin);
        let near_end = NEAR_END_M / lattice.resolution_m;
        // The pose comes from shared memory.
        if !(origin.is_finite() && origin.abs().max_element() < FARTHEST) {
            return Window::default();
        }
        let mut note = |cell: IVec2, result: Beams| {
            // A negative one is a great one without its sign.
            let (col, row) = (cell.x as u32, cell.y as u32);
            let inside = col < lattice.cells && row < lattice.cells;
            if inside {
                let held = &mut results[(row * lattice.cells + col) as usize];
                if *held == Beams::default() {
                    touched.push(Cell { col, row });
                }
                *held = held.and(result);
            }
            inside
        };
        for (beam, &range_m) in fan.beams.iter().enumerate() {
            if range_m.is_nan() || range_m < 0.0 {
                continue;
            }
            let range_m = f64::from(range_m);
            let range = range_m.min(fan.reach_m) / lattice.resolution_m;
            let mut way = Along::new(origin, fan.along(beam));
            let mut inside = true;
            while way.ends() < range && inside {
                let far = way.ends() + near_end < range;
                inside =
                    note(way.cell, Beams::passed(far)) || !left_behind(way.cell, way.step, side);
                way.advance();
            }
            if inside && range_m <= fan.reach_m {
                note(way.cell, Beams::ENDED);
            }
        }
        let mut window = self.stand(sonar, lattice, (robot, radius), flips);
        for cell in touched {
            let index = lattice.index(cell);
            let beams = results[index];
            let is_thing = beams.are_of_a_thing();
            if is_thing && lattice.centre_of(cell).distance(robot) <= radius {
                continue;
            }
            let change = match beams {
                _ if is_thing => HIT,
                Beams { ended: 0, passed_far: true, .. } => -PASS,
                _ => 0,
            };
            window = window.union(self.weigh_seen(sonar, lattice, cell, change, flips));
        }
        window
    }
}

/// Whether a beam outside of the lattice goes farther away from it.
fn left_behind(cell: IVec2, step: IVec2, side: i32) -> bool {
    let beyond = |at: i32, step: i32| at < 0 && step <= 0 || at >= side && step >= 0;
    beyond(cell.x, step.x) || beyond(cell.y, step.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LATTICE: GridFrame = GridFrame { cells: 100, resolution_m: 0.05, centre: DVec2::ZERO };

    /// A grid after these scans of a laser at the centre, whose beams are a degree apart from bearing 0 on.
    fn after(scans: &[Vec<f32>]) -> (EvidenceGrid, Vec<Flip>) {
        let sonar = SonarModel::default();
        let (mut grid, mut flips) = (EvidenceGrid::none(&LATTICE), Vec::new());
        for beams in scans {
            let (first_rad, step_rad) = (0.0, 1_f64.to_radians());
            let fan = Fan { origin: DVec2::ZERO, first_rad, step_rad, reach_m: 8.0, beams };
            grid.take_scan(&sonar, &LATTICE, &fan, (DVec2::ZERO, 0.2), &mut flips);
        }
        (grid, flips)
    }

    fn index(x: f64, y: f64) -> usize {
        LATTICE.index(LATTICE.cell_at(DVec2::new(x, y)).unwrap())
    }

    #[test]
    fn a_beam_frees_the_way_to_its_end_and_knows_nothing_behind_it() {
        let (grid, flips) = after(&[vec![1.0]]);
        assert!(grid.is_occupied(index(1.0, 0.0)));
        assert_eq!(flips.len(), 1);
        let scanned =
            [0.4, 0.9, 1.0, 1.2].map(|x| grid.is_scanned(&SonarModel::default(), index(x, 0.0)));
        assert_eq!(scanned, [true, true, true, false]);
    }

    #[test]
    fn what_goes_away_is_contradicted_by_two_scans() {
        let far = vec![2.0];
        let gone = [vec![1.0], vec![1.0], vec![1.0], far.clone(), far.clone()];
        assert!(after(&gone[..4]).0.is_occupied(index(1.0, 0.0)), "one scan may be wrong");
        assert!(!after(&gone).0.is_occupied(index(1.0, 0.0)));
    }

    #[test]
    fn a_beam_without_a_reading_says_nothing_and_one_without_an_end_frees_its_reach() {
        let (grid, flips) = after(&[vec![f32::NAN, f32::NEG_INFINITY]]);
        assert!(flips.is_empty() && !grid.is_scanned(&SonarModel::default(), index(1.0, 0.0)));
        let (grid, _) = after(&[vec![f32::INFINITY]]);
        assert!(grid.is_scanned(&SonarModel::default(), index(2.4, 0.0)));
    }

    #[test]
    fn a_post_in_a_cell_is_a_thing_and_a_stray_beam_before_a_wall_is_not() {
        // Eleven beams cross the cell at 0.5 m in the directions of 0 to 10 degrees, about half of them through one cell.
        let beams = |near: usize| (0..6).map(|beam| if beam < near { 0.5 } else { 1.5 }).collect();
        assert!(after(&[beams(1)]).0.is_occupied(index(0.5, 0.0)));
        let many = (0..12).map(|beam| if beam == 0 { 0.3 } else { 1.5 }).collect();
        let (grid, _) = after(&[many]);
        assert!(!grid.is_occupied(index(0.3, 0.0)), "one of seven");
    }
}
