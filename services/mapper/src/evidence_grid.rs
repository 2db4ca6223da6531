//! Occupancy evidence grid of the evidential method.
//!
//! Its cells match the sonar's resolution, so the evidence is independent of the field's. A cell
//! holds evidence for an obstacle, the last echo's direction, and whether it was scanned.
//!
//! An echo comes from somewhere on an arc. The arc's cells gain weight, most in the middle; cells
//! before it lose weight. If a well-known occupied cell explains the echo, cells that are not
//! occupied keep their weight. Otherwise every wall would grow at its ends.
//!
//! A laser may look over or through an object, so each laser has its own grid; the other rangers
//! beside lasers share one. A cell is hazard if any grid says so. An echo whose range the laser
//! confirms goes where the laser sees the object.

use std::f64::consts::{PI, SQRT_2, TAU};

use common::{
    grid::{Cell, GridFrame, MAX_CELLS, Window},
    mission::Mission,
};
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    infrared_model::{SCANNED_ASIDE_M, Seen},
    reading::{Ray, Reading, Touch},
    sonar_model::{self as sonar, PASS, POINTED_ENOUGH},
};

/// Cell scanned just now, minus one per [`STEP_M`] of wheel travel.
const SCANNED: u8 = u8::MAX;
/// Wheel travel per step of scanned ground's certainty.
pub(crate) const STEP_M: f64 = sonar::SCANNED_FOR_M / (SCANNED - POINTED_ENOUGH) as f64;

/// Steps of [`SCANNED`] per step of weight: both expire together.
const LOOKS_FOR_A_STEP: u8 = (SCANNED - POINTED_ENOUGH) / sonar::MOST as u8 + 1;

const OCCUPIED: u8 = 1;
/// Flag: seen by an infrared ranger. The sonar may miss it.
const SEEN: u8 = 2;
/// Flag: touched by the body. Rangers may miss it, so none is evidence against it.
const TOUCHED: u8 = 4;
/// Flag: felt by a bumper or cliff sensor. It stays even under a later pose, because wheels slip.
const FELT: u8 = 8;

/// Angle beyond which a crossed cell lies beside the sensor.
const WIDEST_SLACK_RAD: f64 = 1.0;

/// Range tolerance between an echo and the laser's object: the noise of both, and a cell.
const SAME_RANGE_M: f64 = 0.10;
/// Half the angle in which a sonar's lobe hears near objects.
const LOBE_RAD: f64 = 28.0 * TAU / 360.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Flip {
    pub cell: Cell,
    pub occupied: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Ground {
    pub lattice: GridFrame,
    pub radius: f64,
}

/// Changes since the last query.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct News {
    pub flips: Vec<Flip>,
    /// Bounds of newly scanned or expired cells.
    pub window: Window,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct EvidenceGrid {
    /// Weights of the sonar model, offset by 128.
    #[serde(with = "serde_bytes")]
    weight: Vec<u8>,
    /// Direction of the last echo's beam, 1/256 turns.
    #[serde(with = "serde_bytes")]
    side: Vec<u8>,
    /// Scanned from [`SCANNED`] down to [`POINTED_ENOUGH`]; below, number of vain sonar readings.
    #[serde(with = "serde_bytes")]
    looks: Vec<u8>,
    /// Flags [`OCCUPIED`] to [`FELT`].
    #[serde(with = "serde_bytes")]
    occupied: Vec<u8>,
    #[serde(skip)]
    pub ground: Ground,
    #[serde(skip)]
    pub news: News,
}

/// Returns the lattice over the perimeter and `beyond_m` around, where a body inside can touch.
pub(crate) fn lattice(mission: &Mission, beyond_m: f64) -> GridFrame {
    let width = mission.perimeter.width_m;
    let cells = (width / sonar::RESOLUTION_M).ceil().min(f64::from(MAX_CELLS));
    let resolution_m = (width / cells).max(sonar::RESOLUTION_M);
    let beyond = (beyond_m / resolution_m).ceil();
    assert!(cells >= 1.0 && beyond >= 0.0);
    GridFrame {
        cells: (cells + 2.0 * beyond) as u32,
        resolution_m,
        centre: mission.perimeter.centre,
    }
}

impl EvidenceGrid {
    pub(crate) fn new(ground: Ground) -> Self {
        let layer = |byte| vec![byte; ground.lattice.area()];
        Self {
            weight: layer(128),
            side: layer(0),
            looks: layer(0),
            occupied: layer(0),
            ground,
            news: News::default(),
        }
    }

    pub(crate) fn fits(&self, lattice: &GridFrame) -> bool {
        [&self.weight, &self.side, &self.looks, &self.occupied]
            .iter()
            .all(|layer| layer.len() == lattice.area())
    }

    pub(crate) fn is_scanned(&self, index: usize) -> bool {
        self.looks[index] >= POINTED_ENOUGH
    }

    pub(crate) fn is_occupied(&self, index: usize) -> bool {
        self.occupied[index] & OCCUPIED != 0
    }

    pub(crate) fn grow_stale(&mut self, steps: u8) {
        assert_eq!(self.looks.len(), self.ground.lattice.area());
        // Branch-free passes over a row vectorise.
        let is_over =
            |looks: u8| looks >= POINTED_ENOUGH && looks.saturating_sub(steps) < POINTED_ENOUGH;
        let rows = self.looks.chunks_exact_mut(self.ground.lattice.cells as usize);
        for (row, looks) in (0..).zip(rows) {
            if looks.iter().fold(false, |any, &looks| any | is_over(looks)) {
                let over = |looks: &u8| is_over(*looks);
                let ends = [looks.iter().position(over), looks.iter().rposition(over)];
                for col in ends.into_iter().flatten() {
                    self.news.window = self.news.window.including(Cell { col: col as u32, row });
                }
            }
            for looks in looks {
                let less = looks.saturating_sub(steps);
                let less = if less < POINTED_ENOUGH { 0 } else { less };
                *looks = if *looks < POINTED_ENOUGH { *looks } else { less };
            }
        }
    }

    pub(crate) fn forget(&mut self, steps: i8) {
        assert!((1..=sonar::MOST).contains(&steps));
        for cell in self.ground.lattice.whole().cells() {
            let weight = self.weight_of(self.ground.lattice.index(cell));
            if weight != 0 {
                self.set(cell, weight - weight.clamp(-steps, steps));
            }
        }
        self.grow_stale(LOOKS_FOR_A_STEP.saturating_mul(steps.unsigned_abs()));
    }

    /// Applies a reading as evidence up to `reach` metres. If a laser has `seen` its cause, only
    /// cells occupied there get the echo.
    pub(crate) fn take(&mut self, beam: &Reading, reach: f64, seen: Option<&Self>, robot: DVec2) {
        let Ground { lattice, radius } = self.ground;
        let half_cell = lattice.resolution_m / 2.0;
        let half_diagonal = half_cell * SQRT_2;
        let band = sonar::BAND_M.max(half_cell * 1.2);
        assert!(self.fits(&lattice) && seen.is_none_or(|seen| seen.fits(&lattice)));
        assert!(beam.echo.is_none_or(|range| range >= 0.0));
        assert!(!beam.axis.is_finite() || beam.axis.is_normalized());
        let model = &beam.sonar;
        let echo = beam.echo.filter(|range| *range <= reach);
        let passed_to = beam.echo.map_or(f64::INFINITY, |range| range - sonar::BEFORE_M);
        let clear_to = passed_to.min(reach);
        let scanned_to = passed_to.min(model.scanned_m.max(reach));
        let known_to = echo.map_or(scanned_to, |range| range + sonar::BEHIND_M);
        let far = known_to.max(sonar::POINTED_M).max(echo.unwrap_or(0.0) + band);
        let came_from = side_of(beam.axis);
        // Beyond `near`, half a cell's diagonal is narrower than the widest cone.
        let near = half_diagonal / model.arc.sin();
        let outside = model.arc.tan() * (1.0 + 1e-9);

        assert!(near > 0.0 && outside > 0.0, "the cone is narrower than a half turn");
        let mut arc = Vec::new();
        let mut explained = false;
        // All relevant cells lie within `near`, or in the widest cone's triangle.
        let end = far * beam.axis;
        let aside = far * outside * beam.axis.perp();
        let corners = [DVec2::splat(near), DVec2::splat(-near), end + aside, end - aside];
        let least = corners.into_iter().fold(DVec2::ZERO, DVec2::min);
        let greatest = corners.into_iter().fold(DVec2::ZERO, DVec2::max);
        // Tangents avoid an arc tangent per cell, which would take most of a tick.
        let [scanned, pointed, against, at_edge, twice, arc_edge, explains, widest_slack] = [
            model.scanned,
            model.pointed,
            model.against,
            model.against_at_edge,
            model.against * 2.0,
            model.arc,
            model.arc * 1.1,
            WIDEST_SLACK_RAD,
        ]
        .map(f64::tan);
        for cell in lattice.between(beam.origin + least, beam.origin + greatest).cells() {
            let offset = lattice.centre_of(cell) - beam.origin;
            let range = offset.length();
            let across = beam.axis.perp_dot(offset).abs();
            let along = beam.axis.dot(offset);
            if range > far || range > near && across > along * outside {
                continue;
            }
            let is_within = |tangent: f64| across <= along * tangent;
            // Near the sensor the cone is narrower than a cell, so crossed cells are within every
            // angle.
            let is_crossed = across <= half_diagonal && is_within(widest_slack);
            let index = lattice.index(cell);
            if range <= known_to && (is_crossed || is_within(scanned)) {
                self.scan(cell);
            } else if range <= sonar::POINTED_M
                && (is_crossed || is_within(pointed))
                && !self.is_scanned(index)
            {
                if self.looks[index] + 1 < POINTED_ENOUGH {
                    self.looks[index] += 1;
                } else {
                    self.scan(cell);
                }
            }
            if range <= clear_to && (is_within(at_edge) || is_crossed && is_within(twice)) {
                let in_middle = is_crossed || is_within(against);
                let pass = if in_middle { PASS } else { sonar::PASS_AT_EDGE };
                let same = apart(self.side[index], came_from) <= sonar::SAME_SIDE;
                let may_be_unheard = self.occupied[index] & (SEEN | TOUCHED) != 0;
                if self.weight_of(index) <= 0 || same && !may_be_unheard {
                    self.weigh(cell, -pass);
                }
            } else if let Some(echo) = echo
                && (range - echo).abs() <= band
                && (is_crossed || is_within(arc_edge))
            {
                arc.push((cell, across.atan2(along) / model.arc));
                explained |= self.weight_of(index) >= sonar::EXPLAINS && is_within(explains);
            }
        }
        for (cell, off) in arc {
            let index = lattice.index(cell);
            let under_the_robot = lattice.centre_of(cell).distance(robot) <= radius;
            let elsewhere = seen.is_some_and(|seen| !seen.is_occupied(index));
            if under_the_robot || elsewhere || explained && !self.is_occupied(index) {
                continue;
            }
            assert!(off >= 0.0);
            self.side[index] = came_from;
            self.weigh(cell, (sonar::HIT - sonar::HIT * off.min(1.0)) as i8);
        }
        self.stand(robot);
    }

    /// An occupied cell may have caused the echo.
    pub(crate) fn explains(&self, beam: &Reading) -> bool {
        let Some(echo) = beam.echo else {
            return false;
        };
        let lattice = self.ground.lattice;
        assert!(self.fits(&lattice) && echo >= 0.0);
        lattice.around(beam.origin, echo + SAME_RANGE_M).cells().any(|cell| {
            let offset = lattice.centre_of(cell) - beam.origin;
            let off = || beam.axis.perp_dot(offset).atan2(beam.axis.dot(offset)).abs();
            self.is_occupied(lattice.index(cell))
                && (offset.length() - echo).abs() <= SAME_RANGE_M
                && off() <= LOBE_RAD
        })
    }

    /// Marks the footprint scanned and clears obstacles there except felt ones: sensors cannot scan
    /// it.
    pub(crate) fn stand(&mut self, robot: DVec2) {
        let Ground { lattice, radius } = self.ground;
        let touches = radius + lattice.resolution_m;
        for cell in lattice.around(robot, touches).cells() {
            let distance = lattice.centre_of(cell).distance(robot);
            if distance > touches {
                continue;
            }
            self.scan(cell);
            let index = lattice.index(cell);
            let is_felt = self.occupied[index] & FELT != 0;
            if distance <= radius - sonar::RIM_M && self.weight_of(index) > 0 && !is_felt {
                self.set(cell, 0);
            }
        }
    }

    /// Applies an infrared reading: frees passed cells and marks the last one occupied.
    pub(crate) fn take_ray(&mut self, ray: &Ray, robot: DVec2) {
        let Ground { lattice, radius } = self.ground;
        let half_cell = lattice.resolution_m / 2.0;
        let Seen { clear_m, hit_m } = ray.seen;
        assert!(clear_m >= 0.0 && hit_m.is_none_or(|hit_m| clear_m < hit_m));
        assert!(self.fits(&lattice));
        let far = clear_m.max(hit_m.unwrap_or(0.0)) + half_cell;
        let aside = half_cell.max(SCANNED_ASIDE_M);
        let end = ray.origin + far * ray.axis;
        let least = ray.origin.min(end);
        let greatest = ray.origin.max(end);
        let reach = aside + half_cell;
        for cell in lattice.between(least - reach, greatest + reach).cells() {
            let centre = lattice.centre_of(cell);
            let offset = centre - ray.origin;
            let across = ray.axis.perp_dot(offset);
            let along = ray.axis.dot(offset);
            let on_ray = across.abs() <= half_cell;
            if across.abs() > aside || along < -half_cell {
                continue;
            }
            let index = lattice.index(cell);
            let at_hit = hit_m.is_some_and(|hit| (hit - along).abs() <= half_cell);
            if on_ray && at_hit {
                if centre.distance(robot) > radius {
                    self.side[index] = side_of(ray.axis);
                    self.occupied[index] |= SEEN;
                    self.weigh(cell, sonar::HIT as i8);
                }
            } else if along <= clear_m {
                self.scan(cell);
                if on_ray && self.occupied[index] & TOUCHED == 0 {
                    self.weigh(cell, -PASS);
                }
            }
        }
    }

    /// Adds `change`, positive for an obstacle, to a cell that a laser saw, and marks it scanned.
    pub(crate) fn weigh_seen(&mut self, cell: Cell, change: i8) {
        let index = self.ground.lattice.index(cell);
        assert!(change.unsigned_abs() <= sonar::MOST.unsigned_abs());
        let was_occupied = self.is_occupied(index);
        let is_over = change == 0 || change < 0 && self.weight_of(index) == sonar::LEAST;
        let was_scanned = self.is_scanned(index);
        self.scan(cell);
        if was_scanned && is_over {
            return;
        }
        if change > 0 {
            self.occupied[index] |= SEEN;
        }
        if change > 0 || change < 0 && self.occupied[index] & TOUCHED == 0 {
            self.weigh(cell, change);
        }
        if was_occupied != self.is_occupied(index) {
            self.news.window = self.news.window.including(cell);
        }
    }

    pub(crate) fn touch(&mut self, touch: &Touch) {
        let Ground { lattice, radius } = self.ground;
        assert!(self.fits(&lattice));
        assert!(touch.half_width > 0.0 && touch.half_width <= PI);
        let rim = radius - sonar::RIM_M..=radius + lattice.resolution_m;
        for cell in lattice.around(touch.robot, *rim.end()).cells() {
            let offset = lattice.centre_of(cell) - touch.robot;
            let across = touch.axis.perp_dot(offset);
            let along = touch.axis.dot(offset);
            if rim.contains(&offset.length()) && across.atan2(along).abs() <= touch.half_width {
                let index = lattice.index(cell);
                self.side[index] = side_of(touch.axis);
                self.set(cell, sonar::MOST);
                self.occupied[index] |= if touch.is_felt { TOUCHED | FELT } else { TOUCHED };
                self.news.window = self.news.window.including(cell);
            }
        }
    }

    /// Clears scanned ground, and weights farther than `keep` metres from `robot`.
    pub(crate) fn reset(&mut self, robot: DVec2, keep: f64) {
        assert!(keep >= 0.0);
        self.looks.fill(0);
        let lattice = self.ground.lattice;
        for cell in lattice.whole().cells() {
            if lattice.centre_of(cell).distance(robot) > keep {
                self.set(cell, 0);
            }
        }
    }

    fn weight_of(&self, index: usize) -> i8 {
        self.weight[index].wrapping_sub(128).cast_signed()
    }

    fn scan(&mut self, cell: Cell) {
        let index = self.ground.lattice.index(cell);
        if !self.is_scanned(index) {
            self.news.window = self.news.window.including(cell);
        }
        self.looks[index] = SCANNED;
    }

    /// Adds evidence, positive for an obstacle. Long-free cells become occupied as fast as others.
    fn weigh(&mut self, cell: Cell, change: i8) {
        let weight = self.weight_of(self.ground.lattice.index(cell));
        self.set(cell, if change < 0 { weight } else { weight.max(-PASS) } + change);
    }

    fn set(&mut self, cell: Cell, weight: i8) {
        let index = self.ground.lattice.index(cell);
        let weight = weight.clamp(sonar::LEAST, sonar::MOST);
        self.weight[index] = weight.cast_unsigned().wrapping_add(128);
        let was = self.is_occupied(index);
        let occupied = weight >= sonar::OCCUPIED || was && weight > sonar::RELEASED;
        if occupied != was {
            self.occupied[index] ^= OCCUPIED;
            self.news.flips.push(Flip { cell, occupied });
        }
        if !occupied {
            self.occupied[index] &= !(SEEN | TOUCHED | FELT);
        }
    }
}

/// Returns 1/256 turns.
fn side_of(axis: DVec2) -> u8 {
    (axis.to_angle() / TAU * 256.0).rem_euclid(256.0) as u8
}

/// Returns the angle between two sides, radians.
fn apart(a: u8, b: u8) -> f64 {
    let steps = a.wrapping_sub(b);
    f64::from(steps.min(steps.wrapping_neg())) * TAU / 256.0
}
