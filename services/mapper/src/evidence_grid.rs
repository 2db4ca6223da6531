//! The occupancy evidence grid of the evidential method.
//!
//! Its cells follow the sonar's resolution, because the evidence must not depend on the field's. A cell has the weight of the evidence
//! for an obstacle, the direction of the last echo's beam, and whether it was scanned.
//!
//! An echo comes from somewhere on an arc: cells of the arc gain weight, most in the middle, and cells before it along the axis lose
//! weight. A well known occupied cell on the arc explains the echo, and the rest learns nothing; otherwise every wall would grow at each
//! end.
//!
//! An infrared ray is as thin as a cell and ends at a surface of any angle: passed cells are free, the last one is occupied, and silence
//! is no evidence against that.
//!
//! A laser that looks over or through a thing is no evidence against it, so beside it the other rangers have a grid of their own, and a
//! cell of either is hazard. An echo whose range the laser confirms is put where the laser sees the thing. So glass that the laser sees
//! only squarely stays by its echoes.
//!
//! No ranger is evidence against a thing that the body touched: all may look over it.

use std::f64::consts::TAU;

use common::{
    grid::{Cell, GridFrame, MAX_CELLS, Window},
    mission::Mission,
};
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    infrared_model::{SCANNED_ASIDE_M, Seen},
    reading::{Ray, Reading, Touch},
    sonar_model::SonarModel,
};

/// Scanned just now. The value falls by one for every [`step_m`] of the wheels.
const SCANNED: u8 = u8::MAX;

/// Flag: an obstacle stands in the cell.
const OCCUPIED: u8 = 1;
/// Flag: an infrared ranger saw the obstacle, which the sonar may not hear.
const SEEN: u8 = 2;
/// Flag: the body touched the obstacle, which no ranger may see.
const TOUCHED: u8 = 4;

/// A cell crossed by the axis beyond this angle is beside the sensor and not of the beam, radians.
const WIDEST_SLACK_RAD: f64 = 1.0;

/// The greatest difference of range between an echo and the laser's thing, metres: the noise of both, and a cell.
const SAME_RANGE_M: f64 = 0.10;
/// Off its axis, where a sonar's lobe still hears near things, radians.
const LOBE_RAD: f64 = 28.0 * TAU / 360.0;

/// Way of the wheels until scanned ground is one step less certain, metres.
pub(crate) fn step_m(sonar: &SonarModel) -> f64 {
    sonar.scanned_for_m / f64::from(SCANNED - sonar.pointed_enough)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Flip {
    pub(crate) cell: Cell,
    pub(crate) occupied: bool,
}

/// Row-major, one byte a cell and layer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct EvidenceGrid {
    /// Weights of the [`SonarModel`], offset by 128.
    #[serde(with = "serde_bytes")]
    weight: Vec<u8>,
    /// Direction of the last echo's beam, 256ths of a turn.
    #[serde(with = "serde_bytes")]
    side: Vec<u8>,
    /// Scanned from [`SCANNED`] down to [`SonarModel::pointed_enough`]; below that, how often the sonar was pointed at the cell in vain.
    #[serde(with = "serde_bytes")]
    looks: Vec<u8>,
    /// The flags [`OCCUPIED`], [`SEEN`] and [`TOUCHED`].
    #[serde(with = "serde_bytes")]
    occupied: Vec<u8>,
}

/// The lattice over the perimeter and `beyond_m` metres further: a body whose centre is inside can touch an obstacle just outside.
pub(crate) fn lattice(sonar: &SonarModel, mission: &Mission, beyond_m: f64) -> GridFrame {
    let width = mission.perimeter.width_m;
    let cells = (width / sonar.resolution_m).ceil().min(f64::from(MAX_CELLS));
    let resolution_m = (width / cells).max(sonar.resolution_m);
    let beyond = (beyond_m / resolution_m).ceil();
    GridFrame {
        cells: (cells + 2.0 * beyond) as u32,
        resolution_m,
        centre: mission.perimeter.centre,
    }
}

impl EvidenceGrid {
    pub(crate) fn none(lattice: &GridFrame) -> Self {
        let cells = lattice.area();
        Self {
            weight: vec![128; cells],
            side: vec![0; cells],
            looks: vec![0; cells],
            occupied: vec![0; cells],
        }
    }

    pub(crate) fn fits(&self, lattice: &GridFrame) -> bool {
        [&self.weight, &self.side, &self.looks, &self.occupied]
            .iter()
            .all(|layer| layer.len() == lattice.area())
    }

    /// The sonar may also be unable to learn more of the cell.
    pub(crate) fn is_scanned(&self, sonar: &SonarModel, index: usize) -> bool {
        self.looks[index] >= sonar.pointed_enough
    }

    pub(crate) fn is_occupied(&self, index: usize) -> bool {
        self.occupied[index] & OCCUPIED != 0
    }

    /// Lower the certainty of scanned cells by `steps` of the wheels. Returns the window of cells no longer scanned.
    pub(crate) fn grow_stale(
        &mut self,
        sonar: &SonarModel,
        lattice: &GridFrame,
        steps: u8,
    ) -> Window {
        let mut window = Window::default();
        let enough = sonar.pointed_enough;
        // Passes over a row have no branches, so the compiler vectorises them.
        let is_over = |looks: u8| looks >= enough && looks.saturating_sub(steps) < enough;
        let rows = self.looks.chunks_exact_mut(lattice.cells as usize);
        for (row, looks) in (0..).zip(rows) {
            if looks.iter().fold(false, |any, &looks| any | is_over(looks)) {
                let over = |looks: &u8| is_over(*looks);
                let ends = [looks.iter().position(over), looks.iter().rposition(over)];
                for col in ends.into_iter().flatten() {
                    window = window.including(Cell { col: col as u32, row });
                }
            }
            for looks in looks {
                let less = looks.saturating_sub(steps);
                let less = if less < enough { 0 } else { less };
                *looks = if *looks < enough { *looks } else { less };
            }
        }
        window
    }

    /// Take one reading, evidence up to `reach` metres, of a robot at `robot` with a body of `radius` metres. If a laser has `seen` its
    /// cause, only cells occupied there get the echo. Appends flipped cells to `flips` and returns the window of newly scanned ones.
    pub(crate) fn take(
        &mut self,
        sonar: &SonarModel,
        lattice: &GridFrame,
        (beam, reach): (&Reading, f64),
        seen: Option<&Self>,
        (robot, radius): (DVec2, f64),
        flips: &mut Vec<Flip>,
    ) -> Window {
        let mut window = Window::default();
        let half_cell = lattice.resolution_m / 2.0;
        let half_diagonal = half_cell * std::f64::consts::SQRT_2;
        let band = sonar.band_m.max(half_cell * 1.2);
        let echo = beam.echo.filter(|range| *range <= reach);
        let passed_to = beam.echo.map_or(f64::INFINITY, |range| range - sonar.before_m);
        let clear_to = passed_to.min(reach);
        let scanned_to = passed_to.min(sonar.scanned_m.max(reach));
        let known_to = echo.map_or(scanned_to, |range| range + sonar.behind_m);
        let far = known_to.max(sonar.pointed_m).max(echo.unwrap_or(0.0) + band);
        let came_from = side_of(beam.axis);
        // Beyond `near`, half a cell's diagonal is narrower than the widest cone.
        let near = half_diagonal / sonar.arc.sin();
        let outside = sonar.arc.tan() * (1.0 + 1e-9);

        let mut arc = Vec::new();
        let mut explained = false;
        // All cells that matter lie within `near`, or in the triangle of the widest cone.
        let (end, aside) = (far * beam.axis, far * outside * beam.axis.perp());
        let corners = [DVec2::splat(near), DVec2::splat(-near), end + aside, end - aside];
        let least = corners.into_iter().fold(DVec2::ZERO, DVec2::min);
        let greatest = corners.into_iter().fold(DVec2::ZERO, DVec2::max);
        // Tangents stand for the angles: an arc tangent a cell would take most of a tick.
        let [scanned, pointed, against, at_edge, twice, arc_edge, explains, widest_slack] = [
            sonar.scanned,
            sonar.pointed,
            sonar.against,
            sonar.against_at_edge,
            sonar.against * 2.0,
            sonar.arc,
            sonar.arc * 1.1,
            WIDEST_SLACK_RAD,
        ]
        .map(f64::tan);
        for cell in between(lattice, beam.origin + least, beam.origin + greatest) {
            let offset = lattice.centre_of(cell) - beam.origin;
            let range = offset.length();
            let (across, along) = (beam.axis.perp_dot(offset).abs(), beam.axis.dot(offset));
            if range > far || range > near && across > along * outside {
                continue;
            }
            let is_within = |tangent: f64| across <= along * tangent;
            // Near the sensor the cone is narrower than a cell, so a crossed cell is within every angle.
            let is_crossed = across <= half_diagonal && is_within(widest_slack);
            let index = lattice.index(cell);
            if range <= known_to && (is_crossed || is_within(scanned)) {
                let was = std::mem::replace(&mut self.looks[index], SCANNED);
                if was < sonar.pointed_enough {
                    window = window.including(cell);
                }
            } else if range <= sonar.pointed_m
                && (is_crossed || is_within(pointed))
                && self.looks[index] < sonar.pointed_enough
            {
                self.looks[index] += 1;
                if self.looks[index] >= sonar.pointed_enough {
                    self.looks[index] = SCANNED;
                    window = window.including(cell);
                }
            }
            if range <= clear_to && (is_within(at_edge) || is_crossed && is_within(twice)) {
                let in_middle = is_crossed || is_within(against);
                let pass = if in_middle { sonar.pass } else { sonar.pass_at_edge };
                let weight = self.weight_of(index);
                let same = apart(self.side[index], came_from) <= sonar.same_side;
                if weight <= 0 || same && self.occupied[index] & (SEEN | TOUCHED) == 0 {
                    self.set(sonar, lattice, cell, weight.saturating_sub(pass), flips);
                }
            } else if let Some(echo) = echo
                && (range - echo).abs() <= band
                && (is_crossed || is_within(arc_edge))
            {
                arc.push((cell, across.atan2(along) / sonar.arc));
                explained |= self.weight_of(index) >= sonar.explains && is_within(explains);
            }
        }
        for (cell, off) in arc {
            let index = lattice.index(cell);
            let under_the_robot = lattice.centre_of(cell).distance(robot) <= radius;
            let elsewhere = seen.is_some_and(|seen| !seen.is_occupied(index));
            if under_the_robot || elsewhere || explained && !self.is_occupied(index) {
                continue;
            }
            let more = sonar.hit + (sonar.hit_at_edge - sonar.hit) * off.min(1.0);
            // A cell that was long free must not need as long to become occupied.
            let weight = self.weight_of(index).max(-sonar.pass) + more as i8;
            self.side[index] = came_from;
            self.set(sonar, lattice, cell, weight, flips);
        }
        window.union(self.stand(sonar, lattice, (robot, radius), flips))
    }

    /// Whether an occupied cell may have given the echo.
    pub(crate) fn explains(&self, lattice: &GridFrame, beam: &Reading) -> bool {
        let Some(echo) = beam.echo else {
            return false;
        };
        around(lattice, beam.origin, echo + SAME_RANGE_M).any(|cell| {
            let offset = lattice.centre_of(cell) - beam.origin;
            let off = || beam.axis.perp_dot(offset).atan2(beam.axis.dot(offset)).abs();
            self.is_occupied(lattice.index(cell))
                && (offset.length() - echo).abs() <= SAME_RANGE_M
                && off() <= LOBE_RAD
        })
    }

    /// A robot with a body of `radius` metres stands here: no obstacle does, and no sensor can scan the ground that it touches.
    pub(crate) fn stand(
        &mut self,
        sonar: &SonarModel,
        lattice: &GridFrame,
        (robot, radius): (DVec2, f64),
        flips: &mut Vec<Flip>,
    ) -> Window {
        let mut window = Window::default();
        let touches = radius + lattice.resolution_m;
        for cell in around(lattice, robot, touches) {
            let index = lattice.index(cell);
            let distance = lattice.centre_of(cell).distance(robot);
            let stands = distance <= radius - sonar.rim_m && self.weight_of(index) > 0;
            if distance > touches {
                continue;
            }
            let was = std::mem::replace(&mut self.looks[index], SCANNED);
            if stands {
                self.set(sonar, lattice, cell, 0, flips);
            }
            if was < sonar.pointed_enough {
                window = window.including(cell);
            }
        }
        window
    }

    /// Does for an infrared ranger as [`EvidenceGrid::take`].
    pub(crate) fn take_ray(
        &mut self,
        sonar: &SonarModel,
        lattice: &GridFrame,
        ray: &Ray,
        (robot, radius): (DVec2, f64),
        flips: &mut Vec<Flip>,
    ) -> Window {
        let mut window = Window::default();
        let half_cell = lattice.resolution_m / 2.0;
        let Seen { clear_m, hit_m } = ray.seen;
        let far = clear_m.max(hit_m.unwrap_or(0.0)) + half_cell;
        let came_from = side_of(ray.axis);
        let aside = half_cell.max(SCANNED_ASIDE_M);
        let end = ray.origin + far * ray.axis;
        let (least, greatest) = (ray.origin.min(end), ray.origin.max(end));
        let reach = aside + half_cell;
        for cell in between(lattice, least - reach, greatest + reach) {
            let centre = lattice.centre_of(cell);
            let offset = centre - ray.origin;
            let (across, along) = (ray.axis.perp_dot(offset), ray.axis.dot(offset));
            let on_ray = across.abs() <= half_cell;
            if across.abs() > aside || along < -half_cell {
                continue;
            }
            let index = lattice.index(cell);
            let weight = self.weight_of(index);
            let at_hit = hit_m.is_some_and(|hit| (hit - along).abs() <= half_cell);
            if on_ray && at_hit {
                if centre.distance(robot) <= radius {
                    continue;
                }
                self.side[index] = came_from;
                self.occupied[index] |= SEEN;
                let weight = weight.max(-sonar.pass) + sonar.hit as i8;
                self.set(sonar, lattice, cell, weight, flips);
            } else if along <= clear_m {
                let was = std::mem::replace(&mut self.looks[index], SCANNED);
                if was < sonar.pointed_enough {
                    window = window.including(cell);
                }
                if on_ray && self.occupied[index] & TOUCHED == 0 {
                    let weight = weight.saturating_sub(sonar.pass);
                    self.set(sonar, lattice, cell, weight, flips);
                }
            }
        }
        window
    }

    /// Change the weight of a cell that a laser saw, which is then scanned; positive is for an obstacle. Returns whether the cell looks
    /// different.
    pub(crate) fn weigh_seen(
        &mut self,
        sonar: &SonarModel,
        lattice: &GridFrame,
        cell: Cell,
        change: i8,
        flips: &mut Vec<Flip>,
    ) -> bool {
        let index = lattice.index(cell);
        let (weight, was_occupied) = (self.weight_of(index), self.is_occupied(index));
        let was_scanned = self.is_scanned(sonar, index);
        self.looks[index] = SCANNED;
        if was_scanned && change <= 0 && (change == 0 || weight == sonar.least) {
            return false;
        }
        if change > 0 {
            self.occupied[index] |= SEEN;
            self.set(sonar, lattice, cell, weight.max(-sonar.pass).saturating_add(change), flips);
        } else if change < 0 && self.occupied[index] & TOUCHED == 0 {
            self.set(sonar, lattice, cell, weight.saturating_add(change), flips);
        }
        !was_scanned || was_occupied != self.is_occupied(index)
    }

    /// An obstacle stands in every cell at the body's rim in the arc of `touch`.
    pub(crate) fn touch(
        &mut self,
        sonar: &SonarModel,
        lattice: &GridFrame,
        touch: &Touch,
        radius: f64,
        flips: &mut Vec<Flip>,
    ) -> Window {
        let mut window = Window::default();
        let rim = radius - sonar.rim_m..=radius + lattice.resolution_m;
        for cell in around(lattice, touch.robot, radius + lattice.resolution_m) {
            let offset = lattice.centre_of(cell) - touch.robot;
            let (across, along) = (touch.axis.perp_dot(offset), touch.axis.dot(offset));
            if rim.contains(&offset.length()) && across.atan2(along).abs() <= touch.half_width {
                let index = lattice.index(cell);
                self.side[index] = side_of(touch.axis);
                self.set(sonar, lattice, cell, sonar.most, flips);
                self.occupied[index] |= TOUCHED;
                window = window.including(cell);
            }
        }
        window
    }

    /// Keeps echoes from within `keep` metres of `robot`.
    pub(crate) fn reset(
        &mut self,
        sonar: &SonarModel,
        lattice: &GridFrame,
        (robot, keep): (DVec2, f64),
        flips: &mut Vec<Flip>,
    ) {
        for row in 0..lattice.cells {
            for col in 0..lattice.cells {
                let cell = Cell { col, row };
                let index = lattice.index(cell);
                self.looks[index] = 0;
                if lattice.centre_of(cell).distance(robot) > keep {
                    self.set(sonar, lattice, cell, 0, flips);
                }
            }
        }
    }

    fn weight_of(&self, index: usize) -> i8 {
        self.weight[index].wrapping_sub(128).cast_signed()
    }

    fn set(
        &mut self,
        sonar: &SonarModel,
        lattice: &GridFrame,
        cell: Cell,
        weight: i8,
        flips: &mut Vec<Flip>,
    ) {
        let index = lattice.index(cell);
        let weight = weight.clamp(sonar.least, sonar.most);
        self.weight[index] = weight.cast_unsigned().wrapping_add(128);
        let was = self.is_occupied(index);
        let occupied = weight >= sonar.occupied || was && weight > sonar.released;
        if occupied != was {
            self.occupied[index] ^= OCCUPIED;
            flips.push(Flip { cell, occupied });
        }
        if !occupied {
            self.occupied[index] &= !(SEEN | TOUCHED);
        }
    }
}

fn around(frame: &GridFrame, centre: DVec2, reach: f64) -> impl Iterator<Item = Cell> + use<> {
    between(frame, centre - reach, centre + reach)
}

fn between(frame: &GridFrame, least: DVec2, greatest: DVec2) -> impl Iterator<Item = Cell> + use<> {
    let last = f64::from(frame.cells) - 1.0;
    let inside = |corner: DVec2| corner.clamp(DVec2::ZERO, DVec2::splat(last));
    let from = inside(frame.to_cells(least).floor());
    let to = inside(frame.to_cells(greatest).ceil());
    let columns = from.x as u32..=to.x as u32;
    (from.y as u32..=to.y as u32)
        .flat_map(move |row| columns.clone().map(move |col| Cell { col, row }))
}

/// 256ths of a turn.
fn side_of(axis: DVec2) -> u8 {
    (axis.to_angle() / TAU * 256.0).rem_euclid(256.0) as u8
}

/// The angle between two of [`side_of`], radians.
fn apart(a: u8, b: u8) -> f64 {
    let steps = a.wrapping_sub(b);
    f64::from(steps.min(steps.wrapping_neg())) * TAU / 256.0
}
