//! Bug2 planner (V. J. Lumelsky and A. A. Stepanov, Path-planning strategies for a point mobile
//! automaton, Algorithmica 2, 1987).
//!
//! The robot drives straight to the target. It follows a hazard in its way, on its right, until it
//! is back on the line from start to target. There it must be nearer to the target than at the hit
//! point, with a free way ahead.
//!
//! Hazards include the body's margin, so the robot's centre is the point. It sees up to
//! [`AHEAD_M`]. A robot that returns to the hit point has no path.

mod boundary;

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::baselines::{
    belief::Map,
    planner::{Planner, Way},
};
use boundary::Place;

/// Distance to a hit, and to the boundary point that the robot heads for.
const AHEAD_M: f64 = 0.3;
/// Distance at which the robot has left the hit point.
const AWAY_M: f64 = 0.5;
/// Tolerance of the line from start to target, in cells, and its minimum in metres.
const ON_LINE_CELLS: f64 = 0.75;
const ON_LINE_M: f64 = 0.05;
/// Maximum cells of a boundary searched ahead.
const MOST_CELLS: usize = 256;

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Bug {
    /// Map epoch; a new epoch resets all state.
    epoch: u64,
    /// Start of the line to the target, metres; none before the first pose.
    line_from: Option<DVec2>,
    following: Option<Following>,
    enclosed: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Following {
    hit: DVec2,
    place: Place,
    was_away: bool,
}

impl Planner for Bug {
    fn way(&mut self, map: &Map<'_>, here: DVec2, target: DVec2) -> Way {
        if self.epoch != map.epoch {
            *self = Self { epoch: map.epoch, ..Self::default() };
        }
        let line_from = *self.line_from.get_or_insert(here);
        if map.free_cell_at(here).is_none() {
            return Way::out(map, here);
        }
        let way = Straight { map, line_from, target };
        let led_on = |it: Following| {
            it.led_on(map, here, way.left(here)).filter(|it| !way.is_resumed(here, it))
        };
        self.following = self.following.and_then(led_on).or_else(|| way.hit(here));
        let Some(following) = self.following else {
            return Way::To(target);
        };
        self.enclosed |= following.is_back(map);
        if self.enclosed { Way::None } else { Way::To(following.aim(map, here)) }
    }
}

struct Straight<'a> {
    map: &'a Map<'a>,
    line_from: DVec2,
    target: DVec2,
}

impl Straight<'_> {
    /// Returns the last free point before a near hazard ahead of `here`.
    fn blocked(&self, here: DVec2) -> Option<DVec2> {
        let ahead = here + (self.target - here).clamp_length_max(AHEAD_M);
        self.map.last_free(here, ahead)
    }

    fn left(&self, here: DVec2) -> DVec2 {
        (self.target - here).normalize_or(DVec2::X).perp()
    }

    /// Returns the near hazard ahead, to be passed on its left.
    fn hit(&self, here: DVec2) -> Option<Following> {
        let hit = self.blocked(here)?;
        let cell = self.map.free_cell_at(hit)?;
        let place = Place::at(self.map, cell, self.left(here))?;
        Some(Following { hit, place, was_away: false })
    }

    fn is_resumed(&self, here: DVec2, following: &Following) -> bool {
        let cell = self.map.frame.resolution_m;
        let along = (self.target - self.line_from).normalize_or(DVec2::X);
        let off = along.perp_dot(here - self.line_from).abs();
        let nearer = here.distance(self.target) + cell < following.hit.distance(self.target);
        let on_line = off <= (ON_LINE_CELLS * cell).max(ON_LINE_M);
        on_line && nearer && self.blocked(here).is_none()
    }
}

impl Following {
    /// Advances along the boundary to the place nearest to `here`; none if no boundary remains.
    ///
    /// If the map has changed, it follows the boundary near the robot, preferably to the `left` of
    /// the line to the target.
    fn led_on(mut self, map: &Map<'_>, here: DVec2, left: DVec2) -> Option<Self> {
        if !self.place.is_on(map) {
            let cells = [Some(self.place.cell), map.free_cell_at(here)];
            let mut cells = cells.into_iter().flatten();
            self.place = cells.find_map(|cell| Place::at(map, cell, left))?;
        }
        let away = |place: &Place| map.frame.centre_of(place.cell).distance(here);
        // Of equally near places, the last.
        let nearest = self.ahead(map).max_by(|a, b| away(b).total_cmp(&away(a)));
        self.place = nearest.unwrap_or(self.place);
        self.was_away |= here.distance(self.hit) > AWAY_M;
        Some(self)
    }

    fn ahead<'a>(&self, map: &'a Map<'_>) -> impl Iterator<Item = Place> + 'a {
        // A boundary of steps is up to sqrt(2) times as long as it is wide, and folds.
        let cells = (2.0 * AHEAD_M / map.frame.resolution_m).ceil() as usize;
        let from = self.place;
        std::iter::successors(Some(from), |place| place.next(map)).take(cells.min(MOST_CELLS) + 1)
    }

    fn is_back(&self, map: &Map<'_>) -> bool {
        let here = map.frame.centre_of(self.place.cell);
        self.was_away && here.distance(self.hit) <= map.frame.resolution_m
    }

    /// Returns the farthest nearby boundary point in sight.
    fn aim(&self, map: &Map<'_>, here: DVec2) -> DVec2 {
        let centre = |place: Place| map.frame.centre_of(place.cell);
        let near = |point: &DVec2| here.distance(*point) <= AHEAD_M && map.sees(here, *point);
        self.ahead(map).map(centre).filter(near).last().unwrap_or(centre(self.place))
    }
}

#[cfg(test)]
mod tests;
