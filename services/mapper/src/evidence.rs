//! What was heard, for and against: the careful method's memory under the safety map.
//!
//! It has a lattice of its own, as fine as the sonar can tell and no finer, whatever the grid of the map:
//! what the robot believes of the place must not depend on how finely the field is solved. Every cell
//! holds the weight of the evidence that something stands in it, the beam that heard it, and whether the
//! sonar ever looked there.
//!
//! One echo says that something stands somewhere on an arc, and that nothing stands before it. It is
//! mapped as that: weight for every cell of the arc, more in its middle; weight off every cell before it
//! along the axis. Where the arc meets a cell that is well known to be occupied, that explains the echo
//! and the rest of the arc learns nothing, or every wall would grow a wing at each end.

use std::f64::consts::TAU;

use common::{
    grid::{Cell, GridFrame, MAX_CELLS, Window},
    mission::Mission,
};
use glam::DVec2;
use serde::{Deserialize, Serialize};

/// The side of a cell, metres: a third of what the cone is wide where a hit starts to matter.
const RESOLUTION_M: f64 = 0.05;
/// Weights are counted in quarters. An echo in the middle of its arc, and at its end.
const HIT: f64 = 4.0;
const HIT_AT_EDGE: f64 = 2.0;
/// A beam that passed through.
const PASS: i8 = 2;
/// The same at its edge, where it may have missed.
const PASS_AT_EDGE: i8 = 1;
/// More than this is not remembered, for either side: a world that changes is believed soon.
const LEAST: i8 = -8;
const MOST: i8 = 12;
/// From here on a cell is occupied, ...
const OCCUPIED: i8 = 2;
/// ... until it is down here again.
const RELEASED: i8 = 0;
/// From here on it explains an echo.
const STRONG: i8 = 6;
/// Half the angle over which an echo is spread: the cone answers over 15 degrees.
const ARC: f64 = 16.0 * DEGREE;
/// Half the widest angle that anything is asked of.
const WIDEST: f64 = ARC;
/// How far off its range an echo is still it, metres: noise, the byte's centimetre, half a cell.
const BAND_M: f64 = 0.04;
/// Half the angle in which a beam that heard nothing speaks for free ground: less than the cone has, for
/// a flank that only just reaches into the cone throws the sound away.
const SWEEP: f64 = 12.0 * DEGREE;
/// An echo is too wide to be mapped where silence still says that the ground is free: so much farther.
const SWEPT_BEYOND: f64 = 1.25;
/// Half the angle in which it speaks against an echo heard before: at the cone's edge it may have missed.
const AGAINST: f64 = 8.0 * DEGREE;
/// Half the angle in which it does so at all.
const AGAINST_AT_EDGE: f64 = 13.0 * DEGREE;
/// A beam speaks against an echo of a beam that came from about the same side. A smooth wall that is
/// hit at a slant hears nothing, and that is no news of what was heard square to it.
const SAME_SIDE: f64 = 35.0 * DEGREE;
/// What lies nearer than this before an echo may be it, metres.
const BEFORE_M: f64 = 0.08;
/// What lies within this behind an echo was looked at as well as can be, metres.
const BEHIND_M: f64 = 0.10;
/// Half the angle in which the sonar counts as pointed at a cell it cannot see, ...
const POINTED: f64 = 6.0 * DEGREE;
/// ... how far ahead of the sensor, metres, ...
const POINTED_M: f64 = 0.40;
/// ... and how often until there is nothing more to learn from here.
const FRUITLESS: u8 = 4;
/// A cell that was swept just now. It grows stale by one for every [`STALER_M`] the wheels roll.
const SWEPT: u8 = u8::MAX;
/// Wheels slip: after 1.5 m, turns on the spot included, the pose is another than the sonar swept from by
/// about the spare that hazards are given, metres.
pub(crate) const STALER_M: f64 = 1.5 / (SWEPT - FRUITLESS) as f64;
/// Of the footprint this much at the rim is not sure to be free: the pose drifts, metres.
const RIM_M: f64 = 0.02;

const DEGREE: f64 = TAU / 360.0;

/// One reading, where it was taken.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beam {
    /// The sensor, metres.
    pub(crate) origin: DVec2,
    /// Which way it looked: a unit vector.
    pub(crate) axis: DVec2,
    /// The echo's range, metres; none where nothing answered within reach.
    pub(crate) echo: Option<f64>,
    /// How far it speaks at all, metres.
    pub(crate) reach: f64,
}

/// A cell that became occupied or free.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Flip {
    /// The cell of the lattice.
    pub(crate) cell: Cell,
    /// What it is now.
    pub(crate) occupied: bool,
}

/// The evidence of every cell; row-major, one byte a cell each.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Evidence {
    /// Quarters, offset by 128.
    #[serde(with = "serde_bytes")]
    weight: Vec<u8>,
    /// The beam that was heard last: 256ths of a turn.
    #[serde(with = "serde_bytes")]
    side: Vec<u8>,
    /// [`SWEPT`], or how often the sonar was pointed here to no end.
    #[serde(with = "serde_bytes")]
    looks: Vec<u8>,
    /// 1: occupied.
    #[serde(with = "serde_bytes")]
    occupied: Vec<u8>,
}

/// The lattice laid over a mission's perimeter.
pub(crate) fn lattice(mission: &Mission) -> GridFrame {
    let width = mission.perimeter.width_m;
    let cells = (width / RESOLUTION_M).ceil().min(f64::from(MAX_CELLS));
    GridFrame {
        cells: cells as u32,
        resolution_m: (width / cells).max(RESOLUTION_M),
        centre: mission.perimeter.centre,
    }
}

impl Evidence {
    /// Nothing heard yet.
    pub(crate) fn none(lattice: &GridFrame) -> Self {
        let cells = lattice.area();
        Self {
            weight: vec![128; cells],
            side: vec![0; cells],
            looks: vec![0; cells],
            occupied: vec![0; cells],
        }
    }

    /// Whether it is of this lattice.
    pub(crate) fn fits(&self, lattice: &GridFrame) -> bool {
        [&self.weight, &self.side, &self.looks, &self.occupied]
            .iter()
            .all(|layer| layer.len() == lattice.area())
    }

    /// Whether the sonar looked at a cell, or learned all it can of it.
    pub(crate) fn is_swept(&self, index: usize) -> bool {
        self.looks[index] >= FRUITLESS
    }

    /// Whether something stands in a cell.
    pub(crate) fn is_occupied(&self, index: usize) -> bool {
        self.occupied[index] == 1
    }

    /// The wheels have rolled on: what was swept is a little less sure, by `steps`. The window in which
    /// cells are not swept any more.
    pub(crate) fn grow_stale(&mut self, lattice: &GridFrame, steps: u8) -> Window {
        let mut window = Window::default();
        for row in 0..lattice.cells {
            for col in 0..lattice.cells {
                let cell = Cell { col, row };
                let looks = &mut self.looks[lattice.index(cell)];
                if *looks < FRUITLESS {
                    continue;
                }
                *looks = looks.saturating_sub(steps);
                if *looks < FRUITLESS {
                    *looks = 0;
                    window = window.including(cell);
                }
            }
        }
        window
    }

    /// Take one reading of a robot at `robot` with a body of `radius` metres. Appends what flipped to
    /// `flips`; returns the window in which anything changed.
    pub(crate) fn take(
        &mut self,
        lattice: &GridFrame,
        beam: &Beam,
        (robot, radius): (DVec2, f64),
        flips: &mut Vec<Flip>,
    ) -> Window {
        let mut window = Window::default();
        let half_cell = lattice.resolution_m / 2.0;
        let half_diagonal = half_cell * std::f64::consts::SQRT_2;
        let band = BAND_M.max(half_cell * 1.2);
        let echo = beam.echo.filter(|range| *range <= beam.reach);
        let silent_to = beam.echo.map_or(f64::INFINITY, |range| range - BEFORE_M);
        let clear_to = silent_to.min(beam.reach);
        let swept_to = silent_to.min(beam.reach * SWEPT_BEYOND);
        let known_to = echo.map_or(swept_to, |range| range + BEHIND_M);
        let far = known_to.max(POINTED_M).max(echo.unwrap_or(0.0) + band);
        let came_from = side_of(beam.axis);
        // Beyond `near` half a cell's diagonal is narrower than the widest cone.
        let near = half_diagonal / WIDEST.sin();
        let outside = WIDEST.tan() * (1.0 + 1e-9);

        let mut arc = Vec::new();
        let mut explained = false;
        for cell in around(lattice, beam.origin, far) {
            let offset = lattice.centre_of(cell) - beam.origin;
            let range = offset.length();
            let (across, along) = (beam.axis.perp_dot(offset), beam.axis.dot(offset));
            // Most cells around lie outside anything asked below, which is told without an angle.
            if range > far || range > near && across.abs() > along * outside {
                continue;
            }
            let off = across.atan2(along).abs();
            // Half a cell's diagonal seen from the sensor: at its feet the cone is narrower than a cell.
            let slack = (half_diagonal / range.max(half_diagonal)).asin().min(1.0);
            let index = lattice.index(cell);
            if range <= known_to && off <= SWEEP.max(slack) {
                let was = std::mem::replace(&mut self.looks[index], SWEPT);
                if was < FRUITLESS {
                    window = window.including(cell);
                }
            } else if range <= POINTED_M
                && off <= POINTED.max(slack)
                && self.looks[index] < FRUITLESS
            {
                self.looks[index] += 1;
                if self.looks[index] >= FRUITLESS {
                    self.looks[index] = SWEPT;
                    window = window.including(cell);
                }
            }
            if range <= clear_to && off <= AGAINST_AT_EDGE.max(slack.min(AGAINST * 2.0)) {
                let pass = if off <= AGAINST.max(slack) {
                    PASS
                } else {
                    PASS_AT_EDGE
                };
                let weight = self.weight_of(index);
                let same = apart(self.side[index], came_from) <= SAME_SIDE;
                if weight <= 0 || same {
                    self.set(lattice, cell, weight.saturating_sub(pass), flips);
                    window = window.including(cell);
                }
            } else if let Some(echo) = echo
                && (range - echo).abs() <= band
                && off <= ARC.max(slack)
            {
                arc.push((cell, off / ARC));
                explained |= self.weight_of(index) >= STRONG && off <= ARC * 1.1;
            }
        }
        for (cell, off) in arc {
            let index = lattice.index(cell);
            let under_the_robot = lattice.centre_of(cell).distance(robot) <= radius;
            if under_the_robot || explained && !self.is_occupied(index) {
                continue;
            }
            let more = HIT + (HIT_AT_EDGE - HIT) * off.min(1.0);
            // What was believed free for long must not hide something for long.
            let weight = self.weight_of(index).max(-PASS) + more as i8;
            self.side[index] = came_from;
            self.set(lattice, cell, weight, flips);
            window = window.including(cell);
        }
        // Nothing stands where the robot does, and what touches it no sonar can look at.
        let touches = radius + lattice.resolution_m;
        for cell in around(lattice, robot, touches) {
            let index = lattice.index(cell);
            let distance = lattice.centre_of(cell).distance(robot);
            let stands = distance <= radius - RIM_M && self.weight_of(index) > 0;
            if distance > touches {
                continue;
            }
            let was = std::mem::replace(&mut self.looks[index], SWEPT);
            if stands {
                self.set(lattice, cell, 0, flips);
            }
            if stands || was < FRUITLESS {
                window = window.including(cell);
            }
        }
        window
    }

    /// Forget everything but what was heard within `keep` metres of `robot`.
    pub(crate) fn forget(
        &mut self,
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
                    self.set(lattice, cell, 0, flips);
                }
            }
        }
    }

    fn weight_of(&self, index: usize) -> i8 {
        self.weight[index].wrapping_sub(128).cast_signed()
    }

    fn set(&mut self, lattice: &GridFrame, cell: Cell, weight: i8, flips: &mut Vec<Flip>) {
        let index = lattice.index(cell);
        let weight = weight.clamp(LEAST, MOST);
        self.weight[index] = weight.cast_unsigned().wrapping_add(128);
        let was = self.is_occupied(index);
        let occupied = weight >= OCCUPIED || was && weight > RELEASED;
        if occupied != was {
            self.occupied[index] = occupied.into();
            flips.push(Flip { cell, occupied });
        }
    }
}

/// The cells of a square of `reach` metres around `centre`, as far as they lie inside the map.
fn around(frame: &GridFrame, centre: DVec2, reach: f64) -> impl Iterator<Item = Cell> + use<> {
    let last = f64::from(frame.cells) - 1.0;
    let inside = |corner: DVec2| corner.clamp(DVec2::ZERO, DVec2::splat(last));
    let from = inside(frame.to_cells(centre - reach).floor());
    let to = inside(frame.to_cells(centre + reach).ceil());
    let columns = from.x as u32..=to.x as u32;
    (from.y as u32..=to.y as u32)
        .flat_map(move |row| columns.clone().map(move |col| Cell { col, row }))
}

/// 256ths of a turn.
fn side_of(axis: DVec2) -> u8 {
    (axis.to_angle() / TAU * 256.0).rem_euclid(256.0) as u8
}

/// The angle between two sides.
fn apart(a: u8, b: u8) -> f64 {
    let steps = a.wrapping_sub(b);
    f64::from(steps.min(steps.wrapping_neg())) * TAU / 256.0
}
