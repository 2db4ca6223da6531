//! Bug2 (V. J. Lumelsky and A. A. Stepanov, Path-planning strategies for a point mobile automaton, Algorithmica 2, 1987):
//! straight to the target; where a hazard is in the way, around it with the hazard on the right, until the robot is on
//! the line from start to target again, nearer to the target than where it met the hazard, and the way is free.
//!
//! The point of the algorithm is the robot's centre: the map's hazards have the margin of the body. It sees no farther than
//! [`AHEAD_M`]. A robot that comes back to the place where it met the hazard has no way.

mod boundary;

use common::grid::Cell;
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::baselines::{
    belief::Map,
    planner::{Planner, Way},
};
use boundary::Place;

/// Distance at which a hazard ahead counts as met, and to the point of the boundary that the robot heads for, metres.
const AHEAD_M: f64 = 0.3;
/// Distance at which the robot has left the place where it met a hazard, metres.
const AWAY_M: f64 = 0.5;
/// Distance within which the robot is on the line from start to target, in cells, and at least in metres.
const ON_LINE_CELLS: f64 = 0.75;
const ON_LINE_M: f64 = 0.05;
/// The most cells of a boundary that are searched ahead.
const MOST_CELLS: usize = 256;

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Bug {
    /// The epoch of the map. With a new epoch all state is reset.
    epoch: u64,
    /// Start of the line to the target, metres; none before the first pose.
    line_from: Option<DVec2>,
    following: Option<Following>,
    /// Whether the robot came back to the place where it met the hazard.
    enclosed: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Following {
    /// The place where the robot met the hazard, metres.
    hit: DVec2,
    place: Place,
    /// Whether the robot has left the place where it met the hazard.
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
        if let Some(following) = &mut self.following
            && (!following.is_led_on(map, here, way.left(here)) || way.is_resumed(here, following))
        {
            self.following = None;
        }
        if self.following.is_none() {
            let Some(following) = way.hit(here) else {
                return Way::To(target);
            };
            self.following = Some(following);
        }
        let following = self.following.as_ref();
        self.enclosed |= following.is_some_and(|it| it.is_back(map));
        match following {
            Some(following) if !self.enclosed => Way::To(following.aim(map, here)),
            _ => Way::None,
        }
    }
}

struct Straight<'a> {
    map: &'a Map<'a>,
    line_from: DVec2,
    target: DVec2,
}

impl Straight<'_> {
    /// The last free point before the hazard that is near ahead of `here`; none if the way is free.
    fn blocked(&self, here: DVec2) -> Option<DVec2> {
        let ahead = here + (self.target - here).clamp_length_max(AHEAD_M);
        self.map.last_free(here, ahead)
    }

    /// The unit vector to the left of the way from `here`.
    fn left(&self, here: DVec2) -> DVec2 {
        (self.target - here).normalize_or(DVec2::X).perp()
    }

    /// The hazard that is near ahead of `here`, to be gone around to the left; none if the way is free.
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
    /// Advance along the boundary to the place nearest to `here`. Returns whether there still is a boundary. If the map has
    /// changed, the boundary is followed from near the robot, most nearly to the `left` of the line to the target.
    fn is_led_on(&mut self, map: &Map<'_>, here: DVec2, left: DVec2) -> bool {
        if !self.place.is_on(map) {
            let cells = [Some(self.place.cell), map.free_cell_at(here)];
            let mut cells = cells.into_iter().flatten();
            let Some(place) = cells.find_map(|cell| Place::at(map, cell, left)) else {
                return false;
            };
            self.place = place;
        }
        let away = |place: &Place| map.frame.centre_of(place.cell).distance(here);
        let mut nearest = self.place;
        for place in self.ahead(map) {
            if away(&place) <= away(&nearest) {
                nearest = place;
            }
        }
        self.place = nearest;
        self.was_away |= here.distance(self.hit) > AWAY_M;
        true
    }

    fn ahead<'a>(&self, map: &'a Map<'_>) -> impl Iterator<Item = Place> + 'a {
        // A boundary of steps is up to sqrt(2) times as long as it is wide, and folds.
        let cells = (2.0 * AHEAD_M / map.frame.resolution_m).ceil() as usize;
        let from = self.place;
        std::iter::successors(Some(from), |place| place.next(map)).take(cells.min(MOST_CELLS) + 1)
    }

    /// Whether the robot has come back to the place where it met the hazard.
    fn is_back(&self, map: &Map<'_>) -> bool {
        let here = map.frame.centre_of(self.place.cell);
        self.was_away && here.distance(self.hit) <= map.frame.resolution_m
    }

    /// The farthest point of the boundary, along it, that a robot at `here` (metres) sees near by.
    fn aim(&self, map: &Map<'_>, here: DVec2) -> DVec2 {
        let centre = |cell: Cell| map.frame.centre_of(cell);
        let mut aim = centre(self.place.cell);
        for place in self.ahead(map) {
            let point = centre(place.cell);
            if here.distance(point) <= AHEAD_M && map.sees(here, point) {
                aim = point;
            }
        }
        aim
    }
}

#[cfg(test)]
mod tests;
