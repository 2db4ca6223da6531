//! Laser model: a scan as evidence along its beams.
//!
//! A beam is thinner than a cell and ends at a surface of any angle. It frees passed cells and
//! marks the last one occupied. A beam without a reading is no evidence.
//!
//! A scan counts once per cell, although many beams cross near cells. A cell is occupied if a fifth
//! of them end in it: a post or an edge fills only a part. Fewer ends may be noise of a surface
//! behind, which must not close a gap. Neighbours that end farther before that surface than noise
//! explains count, too, as at the edge of a wall seen lengthwise.
//!
//! Where beams are closer than a cell, their ends form a polygon that is filled row by row. Farther
//! away, and beside missing readings, each beam is traced.

use std::ops::Range;

use common::grid::{Cell, GridFrame};
use glam::{DVec2, IVec2};

use crate::{
    evidence_grid::{EvidenceGrid, Ground},
    reading::Fan,
};

/// Weight of beams that end in a cell. One scan makes a free cell occupied.
const HIT: i8 = 6;
/// Weight of beams that all pass a cell. Two scans free a cell that many filled.
const PASS: i8 = 6;
/// Weight where the object continues behind: beams along a wall's face may all miss its edge.
const PASS_ALONG: i8 = 1;

/// Distance behind a cell within which a beam's end is no evidence against it. Along a slanted
/// wall, most beams pass part of a cell before they end in the next.
const NEAR_END_M: f64 = 0.25;
/// Maximum distance of a robot from its map, cells.
const FARTHEST: f64 = 1e6;

/// Maximum passing beams per ending beam in an occupied cell.
const PASS_FOR_ONE_THAT_ENDS: u32 = 4;

/// Number of neighbouring ends in a cell that are not stray.
const NEIGHBOURS: u32 = 2;
/// Practical bound of noise, standard deviations.
const NOISE_DEVIATIONS: f64 = 3.0;

/// Marks: a beam ended in the cell, passed it, passed it and ended far behind.
const ENDED: u8 = 1;
const PASSED: u8 = 2;
const PASSED_FAR: u8 = 4;

#[derive(Clone, Copy)]
struct Beam {
    /// Unit vector.
    along: DVec2,
    /// Range in cells; 0 without a reading.
    range: f64,
    ends: bool,
}

/// Scan in units of lattice cells.
struct Scan<'a> {
    fan: &'a Fan<'a>,
    lattice: &'a GridFrame,
    origin: DVec2,
    beams: Vec<Beam>,
    /// Row-major.
    marks: Vec<u8>,
}

impl EvidenceGrid {
    /// Applies a scan of a robot at `robot`.
    ///
    /// A depth camera cannot see near objects leave, so it ignores those that another laser has
    /// `seen`.
    pub(crate) fn take_scan(&mut self, fan: &Fan<'_>, robot: DVec2, seen: Option<&Self>) {
        let Ground { lattice, radius } = self.ground;
        assert!(self.fits(&lattice) && seen.is_none_or(|seen| seen.fits(&lattice)));
        let Some(mut scan) = Scan::new(&lattice, fan) else {
            return;
        };
        scan.pass(0.0, PASSED);
        scan.pass(NEAR_END_M / lattice.resolution_m, PASSED_FAR);
        scan.end();
        self.stand(robot);
        let side = lattice.cells;
        for (index, mark) in (0..).zip(&scan.marks).filter(|(_, mark)| **mark != 0) {
            let cell = Cell { col: index % side, row: index / side };
            let change = match scan.is_thing(cell, *mark) {
                true if lattice.centre_of(cell).distance(robot) <= radius => continue,
                true if fan.clears_from_m > 0.0 && seen.is_some_and(|it| it.is_thing_at(cell)) => {
                    continue;
                }
                true => HIT,
                false if lattice.centre_of(cell).distance(fan.origin) < fan.clears_from_m => {
                    continue;
                }
                false if mark & (ENDED | PASSED_FAR) != PASSED_FAR => 0,
                false if self.goes_on_behind(cell, fan.origin) => -PASS_ALONG,
                false => -PASS,
            };
            self.weigh_seen(cell, change);
        }
    }

    fn is_thing_at(&self, cell: Cell) -> bool {
        let lattice = self.ground.lattice;
        let beside = lattice.around(lattice.centre_of(cell), lattice.resolution_m);
        beside.cells().any(|cell| self.is_occupied(lattice.index(cell)))
    }

    /// Returns whether the object continues behind this cell as seen from `origin`.
    fn goes_on_behind(&self, cell: Cell, origin: DVec2) -> bool {
        let lattice = self.ground.lattice;
        let is_thing = |cell| self.is_occupied(lattice.index(cell));
        if !is_thing(cell) {
            return false;
        }
        let at = lattice.centre_of(cell);
        let along = (at - origin).normalize_or_zero() * lattice.resolution_m;
        [1.0, 2.0].iter().any(|cells| lattice.cell_at(at + cells * along).is_some_and(is_thing))
    }
}

impl<'a> Scan<'a> {
    /// Returns `None` for an invalid pose, since poses come from shared memory.
    fn new(lattice: &'a GridFrame, fan: &'a Fan<'a>) -> Option<Self> {
        let origin = lattice.to_cells(fan.origin);
        let beam = |(along, range_m): (DVec2, f64)| {
            // A comparison with NaN is false.
            let reads = range_m >= 0.0;
            let range = if reads { range_m.min(fan.reach_m) / lattice.resolution_m } else { 0.0 };
            Beam { along, range, ends: reads && range_m <= fan.reach_m }
        };
        (origin.is_finite() && origin.abs().max_element() < FARTHEST).then(|| Self {
            fan,
            lattice,
            origin,
            beams: fan.iter().map(beam).collect(),
            marks: vec![0; lattice.area()],
        })
    }

    fn pass(&mut self, near: f64, mark: u8) {
        assert!(near >= 0.0 && self.fan.step_rad > 0.0);
        // Beyond this range, a cell may lie between two beams.
        let close = self.fan.step_rad.recip();
        let corner = |beam: &Beam| self.origin + (beam.range - near).clamp(0.0, close) * beam.along;
        let mut corners: Vec<_> = self.beams.iter().map(corner).collect();
        corners.push(self.origin);
        let side = self.lattice.cells;
        fill(side, &corners, |row, columns| {
            let row = (row * side) as usize;
            let cells = row + columns.start as usize..row + columns.end as usize;
            self.marks[cells].iter_mut().for_each(|held| *held |= mark);
        });
        let reads = |number: usize| self.beams.get(number).is_some_and(|beam| beam.range > 0.0);
        for (number, beam) in self.beams.iter().enumerate() {
            let in_polygon = reads(number.wrapping_sub(1)) && reads(number + 1);
            let from = if in_polygon { close } else { 0.0 };
            if beam.range - near <= from {
                continue;
            }
            let mut way = Along::new(self.origin + from * beam.along, beam.along);
            let side = side as i32;
            while from + way.ends() + near < beam.range && !left_behind(way.cell, way.step, side) {
                if let Some(index) = self.index(way.cell) {
                    self.marks[index] |= mark;
                }
                way.advance();
            }
        }
    }

    fn end(&mut self) {
        for beam in self.beams.iter().filter(|beam| beam.ends) {
            let end = self.origin + beam.range * beam.along;
            if let Some(index) = self.index((end + 0.5).floor().as_ivec2()) {
                self.marks[index] |= ENDED;
            }
        }
    }

    fn is_thing(&self, cell: Cell, mark: u8) -> bool {
        if mark & ENDED == 0 {
            return false;
        }
        let offset = DVec2::new(cell.col.into(), cell.row.into()) - self.origin;
        let away = offset.length();
        // Every part of the cell is within this angle of its middle.
        let half = away.max(1.0).recip() / self.fan.step_rad;
        let turn = std::f64::consts::TAU / self.fan.step_rad;
        let middle = (offset.to_angle() - self.fan.first_rad) / self.fan.step_rad;
        let first = (middle - half).rem_euclid(turn);
        let mut ended = 0_u32;
        let mut passed = 0_u32;
        let mut passed_by_noise = 0_u32;
        let mut run = 0_u32;
        let mut neighbours = 0_u32;
        for step in 0..=(2.0 * half).ceil() as usize {
            let beam = (first + step as f64).rem_euclid(turn) as usize;
            let Some(Beam { along, range, ends }) = self.beams.get(beam).copied() else {
                continue;
            };
            let aside = 0.5 * (along.x.abs() + along.y.abs());
            if along.perp_dot(offset).abs() > aside {
                continue;
            }
            let leaves = ((offset + 0.5 * along.signum()) / along).min_element();
            let is_here = || (range * along - offset).abs().max_element() <= 0.5;
            let ends_here = ends && is_here();
            run = if ends_here { run + 1 } else { 0 };
            neighbours = neighbours.max(run);
            ended += u32::from(ends_here);
            let behind = range - leaves;
            passed += u32::from(behind > 0.0);
            passed_by_noise += u32::from(behind > 0.0 && behind <= self.noise(range));
        }
        let is_enough = |passed| ended > 0 && ended * PASS_FOR_ONE_THAT_ENDS >= passed;
        is_enough(passed) || neighbours >= NEIGHBOURS && is_enough(passed_by_noise)
    }

    fn noise(&self, range: f64) -> f64 {
        let (least_m, share) = self.fan.noise;
        NOISE_DEVIATIONS * (least_m / self.lattice.resolution_m + share * range)
    }

    fn index(&self, cell: IVec2) -> Option<usize> {
        // The cast maps negative numbers to large ones.
        let col = cell.x as u32;
        let row = cell.y as u32;
        let side = self.lattice.cells;
        (col < side && row < side).then(|| (row * side + col) as usize)
    }
}

fn fill(side: u32, corners: &[DVec2], mut span: impl FnMut(u32, Range<u32>)) {
    debug_assert!(corners.iter().all(|corner| corner.is_finite()));
    let last = f64::from(side) - 1.0;
    let mut crossings = vec![Vec::new(); side as usize];
    let before = corners.last().into_iter().chain(corners);
    for (from, to) in before.zip(corners) {
        let least = from.y.min(to.y);
        let greatest = from.y.max(to.y);
        let slope = (to.x - from.x) / (to.y - from.y);
        // Of two edges that meet at a row's centre, one crosses it.
        let (first, end) = ((least.floor() + 1.0).max(0.0), greatest.floor().min(last) + 1.0);
        for (row, crossings) in
            crossings.iter_mut().enumerate().take(end as usize).skip(first as usize)
        {
            crossings.push(from.x + (row as f64 - from.y) * slope);
        }
    }
    for (row, crossings) in (0..).zip(&mut crossings) {
        assert!(crossings.len().is_multiple_of(2), "the polygon is closed");
        crossings.sort_unstable_by(f64::total_cmp);
        for pair in crossings.chunks_exact(2) {
            let from = pair[0].ceil().max(0.0);
            let to = pair[1].floor().min(last);
            if from <= to {
                span(row, from as u32..to as u32 + 1);
            }
        }
    }
}

struct Along {
    cell: IVec2,
    step: IVec2,
    /// Ranges to the next column and row line, and from line to line, cells.
    next: DVec2,
    each: DVec2,
}

impl Along {
    fn new(origin: DVec2, along: DVec2) -> Self {
        // Cell centres have integer coordinates.
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

fn left_behind(cell: IVec2, step: IVec2, side: i32) -> bool {
    let beyond = |at: i32, step: i32| at < 0 && step <= 0 || at >= side && step >= 0;
    beyond(cell.x, step.x) || beyond(cell.y, step.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LATTICE: GridFrame = GridFrame { cells: 100, resolution_m: 0.05, centre: DVec2::ZERO };

    /// Returns a grid after scans of a central laser, a beam per degree from bearing 0.
    fn after(scans: &[Vec<f32>]) -> EvidenceGrid {
        after_clearing_from(0.0, None, scans)
    }

    fn after_clearing_from(
        clears_from_m: f64,
        seen: Option<&EvidenceGrid>,
        scans: &[Vec<f32>],
    ) -> EvidenceGrid {
        let mut grid = EvidenceGrid::new(Ground { lattice: LATTICE, radius: 0.2 });
        for beams in scans {
            let fan = Fan { clears_from_m, ..fan(DVec2::ZERO, 1.0, beams) };
            grid.take_scan(&fan, DVec2::ZERO, seen);
        }
        grid
    }

    fn fan(origin: DVec2, step_deg: f64, beams: &[f32]) -> Fan<'_> {
        Fan {
            origin,
            first_rad: 0.0,
            step_rad: step_deg.to_radians(),
            reach_m: 8.0,
            noise: (0.0, 0.0),
            clears_from_m: 0.0,
            beams,
        }
    }

    /// Returns the cell at this x, and y = 0.
    fn ahead(x: f64) -> usize {
        LATTICE.index(LATTICE.cell_at(DVec2::new(x, 0.0)).unwrap())
    }

    fn each(ranges: &[f32]) -> Vec<Vec<f32>> {
        ranges.iter().map(|range| vec![*range]).collect()
    }

    #[test]
    fn what_goes_away_is_contradicted_by_two_scans() {
        let gone = each(&[1.0, 1.0, 1.0, 2.0, 2.0]);
        assert!(after(&gone[..4]).is_occupied(ahead(1.0)), "one scan may be wrong");
        assert!(!after(&gone).is_occupied(ahead(1.0)));
    }

    #[test]
    fn a_depth_camera_keeps_what_it_looks_over_and_takes_no_ground_before_it_for_scanned() {
        let approach = each(&[0.5, 0.5, 2.0, 2.0, 2.0, 2.0]);
        let grid = |from_m| after_clearing_from(from_m, None, &approach);
        assert!(!grid(0.0).is_occupied(ahead(0.5)), "a laser");
        assert!(grid(0.6).is_occupied(ahead(0.5)));
        let scanned = [0.4, 0.7].map(|x| grid(0.6).is_scanned(ahead(x)));
        assert_eq!(scanned, [false, true]);
        let by_laser = after(&approach[..1]);
        let grid = after_clearing_from(0.6, Some(&by_laser), &approach);
        assert!(!grid.is_occupied(ahead(0.5)), "the laser sees it too, and sees it go");
    }

    #[test]
    fn a_beam_without_a_reading_says_nothing_and_one_without_an_end_frees_its_reach() {
        let grid = after(&[vec![f32::NAN, f32::NEG_INFINITY]]);
        assert!(grid.news.flips.is_empty() && !grid.is_scanned(ahead(1.0)));
        assert!(after(&[vec![f32::INFINITY]]).is_scanned(ahead(2.4)));
    }

    #[test]
    fn a_wall_keeps_its_edge_while_the_laser_looks_along_it_and_a_trail_fades() {
        let along = |scans: usize| {
            let far_first = (0..20).rev().flat_map(|cell| vec![vec![1.0 + 0.05 * cell as f32]; 3]);
            after(&Vec::from_iter(far_first.chain(vec![vec![2.3]; scans])))
        };
        assert!(along(5).is_occupied(ahead(1.0)));
        assert!(!along(5).is_occupied(ahead(1.95)), "nothing goes on behind it");
        assert!(!along(12).is_occupied(ahead(1.0)));
    }

    #[test]
    fn two_neighbours_that_end_before_noise_explains_it_are_a_thing_among_many_that_pass() {
        let beams = |near: usize| {
            let beam = |number: usize| if (5..5 + near).contains(&number) { 0.3 } else { 1.5 };
            (0..14).map(beam).collect()
        };
        let place = 0.3 * DVec2::from_angle(5.5_f64.to_radians());
        let place = LATTICE.index(LATTICE.cell_at(place).unwrap());
        assert!(!after(&[beams(1)]).is_occupied(place) && after(&[beams(2)]).is_occupied(place));
    }

    #[test]
    fn a_post_in_a_cell_is_a_thing_and_a_stray_beam_before_a_wall_is_not() {
        // Eleven beams cross the cell at 0.5 m at 0 to 10 degrees, about half of them through one
        // cell.
        let beams = |near: usize| (0..6).map(|beam| if beam < near { 0.5 } else { 1.5 }).collect();
        assert!(after(&[beams(1)]).is_occupied(ahead(0.5)));
        let many = (0..12).map(|beam| if beam == 0 { 0.3 } else { 1.5 }).collect();
        assert!(!after(&[many]).is_occupied(ahead(0.3)), "one of seven");
    }

    #[test]
    fn beams_that_are_close_free_the_cells_that_each_of_them_passes() {
        // The room is 4 m by 4 m with a post.
        let beam = |number: usize| {
            let (sin, cos) = (number as f64 * 0.25).to_radians().sin_cos();
            let wall = 2.0 / cos.abs().max(sin.abs());
            let post = sin.atan2(cos).abs() < 0.05;
            if post { 1.0 } else { wall as f32 }
        };
        let beams = Vec::from_iter((0..1440).map(beam));
        let fan = fan(DVec2::new(0.013, -0.021), 0.25, &beams);
        let mut scan = Scan::new(&LATTICE, &fan).unwrap();
        scan.pass(5.0, PASSED);
        let mut passed = vec![false; LATTICE.area()];
        for beam in &scan.beams {
            for step in 0..((beam.range - 5.0) * 100.0) as u32 {
                let at = scan.origin + f64::from(step) / 100.0 * beam.along;
                passed[scan.index((at + 0.5).floor().as_ivec2()).unwrap()] = true;
            }
        }
        let marked = |index: &usize| scan.marks[*index] != 0;
        let marked = Vec::from_iter((0..passed.len()).filter(marked));
        assert!(marked.iter().all(|index| passed[*index]), "what no beam passed is not free");
        let all = passed.iter().filter(|passed| **passed).count();
        assert!(marked.len() > all * 9 / 10);
    }
}
