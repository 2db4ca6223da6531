//! Direction to follow at any position, equation (11): grad u / |grad u|.
//!
//! At cell centres, the gradient is the central difference of u, with blocked cells as 0. Between
//! centres, it is interpolated bilinearly over the free cells among the four nearest centres, so it
//! is continuous. Cells that meet only across a blocked corner are left out.
//!
//! Near a wall, the component into the wall decreases with the distance and vanishes at the wall.
//! The gradient therefore never leads into a blocked cell. Only ratios of neighbouring u matter, so
//! the common exponent is removed first.

use crate::{
    Cell, Field,
    field::{Place, cell_at},
};

/// Answer of a field at a position; directions are unit vectors (along columns, along rows).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Guidance {
    /// Direction to follow in free space.
    Along([f64; 2]),
    /// Position in the cell of the target.
    AtTarget,
    /// Position in a blocked cell or outside the map; the direction leads to the nearest free cell
    /// that can reach the target.
    WayOut([f64; 2]),
    /// Position without a path to the target, or NaN or infinite coordinates.
    Unreachable,
}

/// Distance from a wall, in cells, below which the component of the gradient into the wall
/// decreases.
const WALL_REACH: f64 = 0.5;

/// Gradient length, relative to the local u, below which a cell is a saddle point.
///
/// At a saddle point the direction leads to the neighbour with the largest u. The limit is above
/// the rounding of the stored u and far below the gradient of other cells.
pub(crate) const SADDLE: f64 = 1e-7;

impl Field {
    /// Returns the guidance at a position in cell units, with cell centres at the integers.
    ///
    /// The direction lacks the gradient's component into walls closer than half a cell.
    pub fn guidance(&self, col: f64, row: f64) -> Guidance {
        if !(col.is_finite() && row.is_finite()) {
            return Guidance::Unreachable;
        }
        // The casts saturate, so far positions stay outside the map.
        let here = (col.round() as i64, row.round() as i64);
        let cell = cell_at(here);
        if self.is_blocked(cell) {
            return self.way_out(col, row);
        }
        if !self.is_reachable(cell) {
            return Guidance::Unreachable;
        }
        if cell == self.target() {
            return Guidance::AtTarget;
        }
        let offset = [col - here.0 as f64, row - here.1 as f64];
        let gradient = self.interpolate(here, offset, |there| self.central_difference(here, there));
        let mut allowed = self.without_wall_component(here, offset, gradient);
        // Steepest ascent replaces the removed component and leads around walls. A gradient
        // straight into a wall would otherwise keep its direction.
        let removed = (gradient[0] - allowed[0]).hypot(gradient[1] - allowed[1]);
        if removed > 0.0 {
            let ascent = self.interpolate(here, offset, |there| {
                self.steepest_ascent(there).map(|step| step as f64)
            });
            let ascent = self.without_wall_component(here, offset, ascent);
            allowed = add_scaled(allowed, removed, ascent);
        }
        unit(allowed, SADDLE)
            .or_else(|| self.toward_best_neighbour(here, [col, row]))
            .map_or(Guidance::Unreachable, Guidance::Along)
    }

    /// Returns the direction at the centre of a cell.
    ///
    /// Returns `None` in blocked cells, cut-off cells and the target. Elsewhere it equals
    /// [`guidance`](Self::guidance).
    pub fn direction(&self, cell: Cell) -> Option<[f64; 2]> {
        if cell == self.target() || !self.is_reachable(cell) {
            return None;
        }
        let here = (cell.col as i64, cell.row as i64);
        let gradient = self.central_difference(here, here);
        unit(gradient, SADDLE)
            .or_else(|| self.toward_best_neighbour(here, [cell.col as f64, cell.row as f64]))
    }

    /// Returns the bilinear mean of `value` over the reachable cells among the four centres around
    /// the position at `offset` from the centre of `here`.
    fn interpolate(
        &self,
        here: Place,
        offset: [f64; 2],
        value: impl Fn(Place) -> [f64; 2],
    ) -> [f64; 2] {
        let side = |o: f64| if o < 0.0 { -1 } else { 1 };
        let (col, row) = (here.0 + side(offset[0]), here.1 + side(offset[1]));
        let [x, y] = offset.map(f64::abs);

        assert!(x <= 0.5 && y <= 0.5);
        let free = |place| !self.u_at(place).is_zero();
        let beside = free((col, here.1));
        let below = free((here.0, row));
        let diagonal = (beside || below) && free((col, row));

        let mut sum = [0.0; 2];
        for (used, there, weight) in [
            (true, here, (1.0 - x) * (1.0 - y)),
            (beside, (col, here.1), x * (1.0 - y)),
            (below, (here.0, row), (1.0 - x) * y),
            (diagonal, (col, row), x * y),
        ] {
            if used && weight > 0.0 {
                sum = add_scaled(sum, weight, value(there));
            }
        }
        sum
    }

    /// In units of u(here).
    fn central_difference(&self, here: Place, there: Place) -> [f64; 2] {
        let own = self.u_at(there);
        assert!(!own.is_zero(), "the cell is reachable");
        let u = |dc: i64, dr: i64| {
            let beside = self.u_at((there.0 + dc, there.1 + dr));
            beside.relative_to(own.exponent) / own.mantissa
        };
        let relative = [0.5 * (u(1, 0) - u(-1, 0)), 0.5 * (u(0, 1) - u(0, -1))];
        let weight = self.ratio(here, there);
        relative.map(|component| weight * component)
    }

    /// Returns u(there) / u(here).
    ///
    /// A diagonal neighbour is reached by way of a free cell beside both.
    fn ratio(&self, here: Place, there: Place) -> f64 {
        let step = |from, to| {
            let own = self.u_at(from);
            assert!(!own.is_zero());
            self.u_at(to).relative_to(own.exponent) / own.mantissa
        };
        if here == there {
            1.0
        } else if here.0 == there.0 || here.1 == there.1 {
            step(here, there)
        } else {
            let beside = (there.0, here.1);
            let zero = self.u_at(beside).is_zero();
            let between = if zero { (here.0, there.1) } else { beside };
            step(here, between) * step(between, there)
        }
    }

    /// Removes from `gradient` the component into blocked cells: all at the wall, nothing half a
    /// cell away.
    ///
    /// Each blocked neighbour acts through its nearest point. A diagonal neighbour counts only if
    /// both cells beside it are free; otherwise a wall past the corner would stop motion along it.
    /// At most two neighbours, at right angles, are within reach, so their order is irrelevant.
    fn without_wall_component(
        &self,
        here: Place,
        offset: [f64; 2],
        mut gradient: [f64; 2],
    ) -> [f64; 2] {
        let blocked = |dc: i64, dr: i64| self.is_blocked(cell_at((here.0 + dc, here.1 + dr)));
        for (dc, dr) in [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1)] {
            let diagonal = dc != 0 && dr != 0;
            if !blocked(dc, dr) || (diagonal && (blocked(dc, 0) || blocked(0, dr))) {
                continue;
            }
            let component = |step: i64, o: f64| {
                if step == 0 { 0.0 } else { step as f64 * 0.5 - o }
            };
            let toward = [component(dc, offset[0]), component(dr, offset[1])];
            let distance = toward[0].hypot(toward[1]);
            if distance >= WALL_REACH {
                continue;
            }
            let normal = if distance > 0.0 {
                [toward[0] / distance, toward[1] / distance]
            } else {
                let length = (dc as f64).hypot(dr as f64);
                [dc as f64 / length, dr as f64 / length]
            };
            let inward = gradient[0] * normal[0] + gradient[1] * normal[1];
            debug_assert!((normal[0].hypot(normal[1]) - 1.0).abs() < 1e-9);
            if inward > 0.0 {
                let share = inward * (1.0 - distance / WALL_REACH);
                gradient = add_scaled(gradient, -share, normal);
            }
        }
        gradient
    }

    /// Two adjacent cells are convex together, so the straight way is free from anywhere in `here`.
    fn toward_best_neighbour(&self, here: Place, position: [f64; 2]) -> Option<[f64; 2]> {
        debug_assert!(!self.u_at(here).is_zero());
        let [dc, dr] = self.steepest_ascent(here).map(|step| step as f64);
        unit([here.0 as f64 + dc - position[0], here.1 as f64 + dr - position[1]], 0.0)
    }

    fn way_out(&self, col: f64, row: f64) -> Guidance {
        let (width, height) = (self.width() as i64, self.height() as i64);
        // Far outside, the search starts at the rim of the map.
        let from = ((col.round() as i64).clamp(-1, width), (row.round() as i64).clamp(-1, height));
        let mut best: Option<(f64, Place)> = None;
        for ring in 1..=width.max(height) + 1 {
            // Every cell of this ring and beyond is at least `ring` away.
            if best.is_some_and(|(distance, _)| distance <= ring as f64) {
                break;
            }
            for (c, r) in ring_cells(from, ring, width, height) {
                if !self.u_at((c, r)).is_zero() {
                    let distance = (c as f64 - from.0 as f64).hypot(r as f64 - from.1 as f64);
                    if best.is_none_or(|(least, _)| distance < least) {
                        best = Some((distance, (c, r)));
                    }
                }
            }
        }
        best.and_then(|(_, cell)| unit([cell.0 as f64 - col, cell.1 as f64 - row], 0.0))
            .map_or(Guidance::Unreachable, Guidance::WayOut)
    }
}

fn ring_cells(centre: Place, ring: i64, width: i64, height: i64) -> impl Iterator<Item = Place> {
    let columns = (centre.0 - ring).max(0)..=(centre.0 + ring).min(width - 1);
    let rows = (centre.1 - ring + 1).max(0)..=(centre.1 + ring - 1).min(height - 1);
    let edges =
        [centre.1 - ring, centre.1 + ring].into_iter().filter(move |r| (0..height).contains(r));
    let sides =
        [centre.0 - ring, centre.0 + ring].into_iter().filter(move |c| (0..width).contains(c));
    edges
        .flat_map(move |r| columns.clone().map(move |c| (c, r)))
        .chain(sides.flat_map(move |c| rows.clone().map(move |r| (c, r))))
}

pub(crate) fn add_scaled(vector: [f64; 2], factor: f64, other: [f64; 2]) -> [f64; 2] {
    [vector[0] + factor * other[0], vector[1] + factor * other[1]]
}

fn unit(vector: [f64; 2], least: f64) -> Option<[f64; 2]> {
    let length = vector[0].hypot(vector[1]);
    (length > least && length.is_finite()).then(|| [vector[0] / length, vector[1] / length])
}
