//! World of a mission, with things that appear, vanish or move.

use common::{
    geometry::{Profile, Shapes, distance_to_segment, nearest_on_segment},
    kinematics::{Pose2, Twist},
    mission::{Footprint, Heights, Hole, Mission, Move, Thing, lasts},
};
use glam::DVec2;

use crate::people::People;

const TOUCHES_M: f64 = 1e-3;

#[derive(Clone, Copy)]
pub enum Surface {
    Drum {
        at: DVec2,
        radius: f64,
    },
    /// Straight face of a wall or a box.
    Face {
        from: DVec2,
        to: DVec2,
    },
}

impl Surface {
    /// Returns metres; negative inside a drum.
    pub fn distance(&self, point: DVec2) -> f64 {
        match *self {
            Self::Drum { at, radius } => at.distance(point) - radius,
            Self::Face { from, to } => distance_to_segment(point, from, to),
        }
    }

    /// Returns the outward direction; none on the surface.
    pub fn outward(&self, point: DVec2) -> Option<DVec2> {
        let from = match *self {
            Self::Drum { at, .. } => at,
            Self::Face { from, to } => nearest_on_segment(point, from, to),
        };
        (point - from).try_normalize()
    }

    pub fn hit(&self, origin: DVec2, along: DVec2) -> Option<f64> {
        match *self {
            Self::Drum { at, radius } => {
                let to_centre = at - origin;
                let ahead = to_centre.dot(along);
                let half_chord = radius * radius - (to_centre.length_squared() - ahead * ahead);
                if half_chord < 0.0 {
                    return None;
                }
                let range = ahead - half_chord.sqrt();
                let inside = to_centre.length_squared() < radius * radius;
                (range >= 0.0 || inside).then_some(range.max(0.0))
            }
            Self::Face { from, to } => {
                let edge = to - from;
                let across = along.perp_dot(edge);
                if across.abs() < 1e-12 {
                    return None;
                }
                let range = (from - origin).perp_dot(edge) / across;
                let share = (from - origin).perp_dot(along) / across;
                (range >= 0.0 && (0.0..=1.0).contains(&share)).then_some(range)
            }
        }
    }

    pub fn incidence_cos(&self, point: DVec2, along: DVec2) -> f64 {
        let normal = match *self {
            Self::Drum { at, .. } => point - at,
            Self::Face { from, to } => (to - from).perp(),
        };
        normal.normalize_or_zero().dot(along).abs()
    }

    fn moved(self, by: DVec2) -> Self {
        match self {
            Self::Drum { at, radius } => Self::Drum { at: at + by, radius },
            Self::Face { from, to } => Self::Face { from: from + by, to: to + by },
        }
    }
}

#[derive(Clone, Copy)]
pub struct Solid {
    pub surface: Surface,
    pub profile: Profile,
}

fn solids_of(shapes: &Shapes) -> Vec<Solid> {
    let drums = shapes.drums.iter().map(|drum| Solid {
        surface: Surface::Drum { at: drum.at, radius: drum.radius_m },
        profile: drum.profile(),
    });
    let face = |profile| move |(from, to)| Solid { surface: Surface::Face { from, to }, profile };
    let walls = shapes.walls.iter().flat_map(|wall| wall.edges().map(face(wall.profile())));
    let boxes = shapes.boxes.iter().flat_map(|block| block.edges().map(face(block.profile())));
    drums.chain(walls).chain(boxes).collect()
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Other {
    pub time_s: f64,
    pub pose: Pose2,
    pub twist: Twist,
    pub radius_m: f64,
    /// Polygon that replaces the disc.
    pub footprint: Option<Footprint>,
    pub profile: Profile,
}

impl Other {
    /// Extrapolates at constant velocity.
    fn solids_at(&self, time: f64) -> Vec<Solid> {
        let for_s = time - self.time_s;
        let pose = self.pose.along_arc(self.twist.v * for_s, self.twist.omega * for_s);
        let surfaces = match &self.footprint {
            None => vec![Surface::Drum { at: pose.position, radius: self.radius_m }],
            Some(footprint) => {
                let placed = |corner| pose.position + pose.axis().rotate(corner);
                let face = |(from, to)| Surface::Face { from: placed(from), to: placed(to) };
                footprint.edges().map(face).collect()
            }
        };
        surfaces.into_iter().map(|surface| Solid { surface, profile: self.profile }).collect()
    }
}

pub struct World {
    standing: Vec<Solid>,
    things: Vec<Visitor>,
    people: People,
    /// The world's other robot, extrapolated from its place.
    pub other: Option<Other>,
    met: Vec<Solid>,
    holes: Vec<Hole>,
    pub heights: Heights,
}

struct Visitor {
    thing: Thing,
    solids: Vec<Solid>,
    offset: DVec2,
    present: bool,
}

impl World {
    pub fn new(mission: &Mission) -> Self {
        let visitor = |thing: &Thing| Visitor {
            solids: solids_of(&thing.shape),
            thing: thing.clone(),
            offset: DVec2::ZERO,
            present: false,
        };
        let mut world = Self {
            standing: solids_of(&mission.world),
            things: mission.simulation.things.iter().map(visitor).collect(),
            people: People::new(&mission.simulation.people),
            other: None,
            met: Vec::new(),
            holes: mission.simulation.holes.clone(),
            heights: mission.simulation.physics().heights,
        };
        world.advance(0.0, DVec2::ZERO, mission.body().radius_m);
        world
    }

    /// Advances to `time`. An obstacle due inside the robot, a disc, waits until its place is free.
    pub fn advance(&mut self, time: f64, centre: DVec2, radius: f64) {
        for visitor in &mut self.things {
            visitor.offset = offset_at(&visitor.thing.moves, time);
            let due = lasts(time, visitor.thing.from_s, visitor.thing.until_s);
            visitor.present = due && (visitor.present || visitor.is_clear_of(centre, radius));
        }
        self.met = self.other.map_or_else(Vec::new, |other| other.solids_at(time));
        self.people.advance(time, (centre, radius), &self.standing);
    }

    pub fn is_hole(&self, point: DVec2) -> bool {
        self.holes.iter().any(|hole| hole.contains(point))
    }

    pub fn solids(&self) -> impl Iterator<Item = Solid> {
        let visiting = self.things.iter().filter(|visitor| visitor.present);
        let visiting = visiting.flat_map(Visitor::now).chain(self.people.solids());
        let visiting = visiting.chain(self.met.iter().copied());
        self.standing.iter().copied().chain(visiting)
    }

    pub fn touchable(&self) -> impl Iterator<Item = Surface> {
        let Heights { ground_clearance_m, body_top_m, .. } = self.heights;
        self.solids()
            .filter(move |solid| solid.profile.is_between(ground_clearance_m, body_top_m))
            .map(|solid| solid.surface)
    }

    pub fn first_hit(&self, origin: DVec2, along: DVec2, height_m: f64) -> Option<(f64, Surface)> {
        self.solids()
            .filter(|solid| solid.profile.height_gap(height_m) == 0.0)
            .filter_map(|Solid { surface, .. }| Some((surface.hit(origin, along)?, surface)))
            .min_by(|(a, _), (b, _)| a.total_cmp(b))
    }

    /// Returns solids within `reach_m` at which a beam from `height_m` may end.
    ///
    /// A level beam meets solids at that height. One that widens by `rise` per metre meets those
    /// that the body can touch.
    pub fn near(&self, point: DVec2, reach_m: f64, height_m: f64, rise: f64) -> Vec<Solid> {
        let Heights { ground_clearance_m, body_top_m, .. } = self.heights;
        let is_touched =
            |solid: &Solid| rise == 0.0 || solid.profile.is_between(ground_clearance_m, body_top_m);
        self.solids()
            .filter(is_touched)
            .filter(|solid| solid.profile.height_gap(height_m) <= rise * reach_m)
            .filter(|solid| solid.surface.distance(point) <= reach_m)
            .collect()
    }

    /// Returns whether a surface at `height_m` is between the points, or within [`TOUCHES_M`] of
    /// the second.
    ///
    /// A touched object may lie between the body's centre and a sensor at its edge.
    pub fn is_between(&self, from: DVec2, to: DVec2, height_m: f64) -> bool {
        let Some(along) = (to - from).try_normalize() else {
            return false;
        };
        let hit = self.first_hit(from, along, height_m);
        hit.is_some_and(|(range, _)| range <= (to - from).length() + TOUCHES_M)
    }
}

impl Visitor {
    fn now(&self) -> impl Iterator<Item = Solid> {
        self.solids
            .iter()
            .map(|solid| Solid { surface: solid.surface.moved(self.offset), ..*solid })
    }

    fn is_clear_of(&self, centre: DVec2, radius: f64) -> bool {
        let inside_box = self.thing.shape.clearance(centre - self.offset) < 0.0;
        let touches = |solid: Solid| solid.surface.distance(centre) <= radius;
        !inside_box && !self.now().any(touches)
    }
}

fn offset_at(moves: &[Move], time: f64) -> DVec2 {
    let next = moves.partition_point(|station| station.at_s <= time);
    let before = next.checked_sub(1).and_then(|last| moves.get(last));
    match (before, moves.get(next)) {
        (Some(before), Some(after)) => {
            let share = (time - before.at_s) / (after.at_s - before.at_s);
            assert!((0.0..=1.0).contains(&share));
            before.by.lerp(after.by, share)
        }
        (Some(only), None) | (None, Some(only)) => only.by,
        (None, None) => DVec2::ZERO,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::mission;

    impl World {
        /// Returns metres to the nearest touchable surface; infinite without one.
        fn clearance(&self, point: DVec2) -> f64 {
            self.touchable().map(|surface| surface.distance(point)).fold(f64::INFINITY, f64::min)
        }
    }

    fn world(text: &str) -> World {
        World::new(&mission(text))
    }

    #[test]
    fn a_thing_comes_moves_in_a_straight_line_and_goes() {
        let mut world = world(
            "[[simulation.thing]]\nfrom_s = 1\nuntil_s = 9\nshape.drum = [{ at = [0, 5], radius_m = 1 }]\nmoves = [{ at_s = 2, by = [0, 0] }, { at_s = 4, by = [0, -2] }]",
        );
        let clearances = [0.5, 1.5, 3.0, 8.0, 9.0].map(|time| {
            world.advance(time, DVec2::ZERO, 0.1);
            world.clearance(DVec2::ZERO)
        });
        assert_eq!(clearances, [f64::INFINITY, 4.0, 3.0, 2.0, f64::INFINITY]);
    }

    #[test]
    fn nothing_appears_inside_the_robot() {
        let mut world = world(
            "[[simulation.thing]]\nfrom_s = 1\nshape.box = [{ at = [1, 0], size_m = [1, 1] }]",
        );
        world.advance(2.0, DVec2::new(1.0, 0.0), 0.1);
        // It waits.
        assert_eq!(world.clearance(DVec2::ZERO), f64::INFINITY);
        world.advance(3.0, DVec2::new(0.0, 0.0), 0.1);
        assert_eq!(world.clearance(DVec2::ZERO), 0.5);
    }

    #[test]
    fn what_is_low_or_hangs_over_is_touched_only_where_the_body_is_as_high() {
        let clearance = |heights: &str| {
            world(&format!("world.box = [{{ at = [1, 0], size_m = [1, 1], {heights} }}]"))
                .clearance(DVec2::ZERO)
        };
        // A low box, a door sill, the bar of a chair and a table top.
        let heights = ["top_m = 0.1", "top_m = 0.02", "bottom_m = 0.22", "bottom_m = 0.7"];
        assert_eq!(heights.map(clearance), [0.5, f64::INFINITY, 0.5, f64::INFINITY]);
    }
}
