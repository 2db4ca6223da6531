//! What stands around the robot: the mission's world, and things that appear, vanish or move.

use common::{
    geometry::{Shapes, nearest_on_segment},
    mission::{Mission, Thing},
};
use glam::DVec2;

/// One surface: all the robot can touch or hear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Surface {
    /// A disc.
    Drum {
        /// Centre, metres.
        at: DVec2,
        /// Radius, metres.
        radius: f64,
    },
    /// A straight face of a wall or a box.
    Face {
        /// One end, metres.
        from: DVec2,
        /// The other.
        to: DVec2,
    },
}

impl Surface {
    /// Distance from `point` to this surface, metres; negative inside a drum.
    #[must_use]
    pub fn distance(&self, point: DVec2) -> f64 {
        match *self {
            Self::Drum { at, radius } => at.distance(point) - radius,
            Self::Face { from, to } => nearest_on_segment(point, from, to).distance(point),
        }
    }

    /// The direction from this surface straight out to `point`; none where it has none.
    #[must_use]
    pub fn outward(&self, point: DVec2) -> Option<DVec2> {
        let from = match *self {
            Self::Drum { at, .. } => at,
            Self::Face { from, to } => nearest_on_segment(point, from, to),
        };
        (point - from).try_normalize()
    }

    /// Distance along the ray from `origin` in the unit direction `along` to this surface, metres.
    #[must_use]
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

    fn moved(self, by: DVec2) -> Self {
        match self {
            Self::Drum { at, radius } => Self::Drum {
                at: at + by,
                radius,
            },
            Self::Face { from, to } => Self::Face {
                from: from + by,
                to: to + by,
            },
        }
    }
}

fn surfaces_of(shapes: &Shapes) -> Vec<Surface> {
    let drums = shapes.drums.iter().map(|drum| Surface::Drum {
        at: drum.at,
        radius: drum.radius_m,
    });
    let faces = shapes.edges().map(|(from, to)| Surface::Face { from, to });
    drums.chain(faces).collect()
}

/// Everything that stands, at one time.
#[derive(Clone, Debug)]
pub struct World {
    standing: Vec<Surface>,
    things: Vec<Visitor>,
}

/// A thing that is not always there.
#[derive(Clone, Debug)]
struct Visitor {
    thing: Thing,
    /// As the mission writes it.
    surfaces: Vec<Surface>,
    /// Where it is now.
    offset: DVec2,
    present: bool,
}

impl World {
    /// The world of `mission` at time 0, with the robot at the start.
    #[must_use]
    pub fn new(mission: &Mission) -> Self {
        let visitor = |thing: &Thing| Visitor {
            surfaces: surfaces_of(&thing.shape),
            thing: thing.clone(),
            offset: DVec2::ZERO,
            present: false,
        };
        let mut world = Self {
            standing: surfaces_of(&mission.world),
            things: mission.simulation.things.iter().map(visitor).collect(),
        };
        world.advance(0.0, DVec2::ZERO, mission.body().radius_m);
        world
    }

    /// Let things come, go and move until `time`, seconds. Nothing appears inside the robot, a disc of
    /// `radius` at `centre`: it waits until the place is free.
    pub fn advance(&mut self, time: f64, centre: DVec2, radius: f64) {
        for visitor in &mut self.things {
            visitor.offset = visitor.thing.offset_at(time);
            let due = time >= visitor.thing.from_s
                && visitor.thing.until_s.is_none_or(|until| time < until);
            visitor.present = due && (visitor.present || visitor.is_clear_of(centre, radius));
        }
    }

    /// Every surface that is there now.
    pub fn surfaces(&self) -> impl Iterator<Item = Surface> + '_ {
        let visiting = self.things.iter().filter(|visitor| visitor.present);
        self.standing
            .iter()
            .copied()
            .chain(visiting.flat_map(Visitor::now))
    }

    /// Distance from `point` to the nearest surface, metres; infinite where nothing stands.
    #[must_use]
    pub fn clearance(&self, point: DVec2) -> f64 {
        self.surfaces()
            .map(|surface| surface.distance(point))
            .fold(f64::INFINITY, f64::min)
    }

    /// Distance along the ray from `origin` in the unit direction `along` to the first surface, metres,
    /// and that surface.
    #[must_use]
    pub fn first_hit(&self, origin: DVec2, along: DVec2) -> Option<(f64, Surface)> {
        self.surfaces()
            .filter_map(|surface| Some((surface.hit(origin, along)?, surface)))
            .min_by(|(a, _), (b, _)| a.total_cmp(b))
    }
}

impl Visitor {
    fn now(&self) -> impl Iterator<Item = Surface> + '_ {
        self.surfaces
            .iter()
            .map(|surface| surface.moved(self.offset))
    }

    fn is_clear_of(&self, centre: DVec2, radius: f64) -> bool {
        let inside_box = self.thing.shape.clearance(centre - self.offset) < 0.0;
        !inside_box && self.now().all(|surface| surface.distance(centre) > radius)
    }
}

trait Itinerary {
    fn offset_at(&self, time: f64) -> DVec2;
}

impl Itinerary for Thing {
    /// Where the thing is at `time`, from where its shape says.
    fn offset_at(&self, time: f64) -> DVec2 {
        let next = self.moves.partition_point(|station| station.at_s <= time);
        let before = next.checked_sub(1).and_then(|last| self.moves.get(last));
        match (before, self.moves.get(next)) {
            (Some(before), Some(after)) => {
                let share = (time - before.at_s) / (after.at_s - before.at_s);
                before.by.lerp(after.by, share)
            }
            (Some(only), None) | (None, Some(only)) => only.by,
            (None, None) => DVec2::ZERO,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn world(text: &str) -> World {
        let text = format!("target = [0, -5]\n{text}");
        World::new(&Mission::parse(&text, Path::new("m.toml")).unwrap())
    }

    #[test]
    fn a_ray_stops_at_the_first_surface_by_hand() {
        let world = world(
            "world.drum = [{ at = [3, 0], radius_m = 0.5 }]\nworld.wall = [{ points = [[2, -1], [2, 1]] }]",
        );
        let (range, _) = world.first_hit(DVec2::ZERO, DVec2::X).unwrap();
        assert_eq!(range, 2.0, "the wall hides the drum");
        let (range, _) = world.first_hit(DVec2::new(4.0, 0.0), DVec2::NEG_X).unwrap();
        assert_eq!(range, 0.5, "from behind, the drum");
        assert_eq!(world.first_hit(DVec2::ZERO, DVec2::Y), None);
        assert_eq!(
            world.first_hit(DVec2::ZERO, DVec2::NEG_X),
            None,
            "a ray does not look back"
        );
    }

    #[test]
    fn a_thing_comes_moves_in_a_straight_line_and_goes() {
        let mut world = world(
            "[[simulation.thing]]\nfrom_s = 1\nuntil_s = 9\nshape.drum = [{ at = [0, 5], radius_m = 1 }]\nmoves = [{ at_s = 2, by = [0, 0] }, { at_s = 4, by = [0, -2] }]",
        );
        let mut at = |time| {
            world.advance(time, DVec2::ZERO, 0.1);
            world.clearance(DVec2::ZERO)
        };
        assert_eq!(at(0.5), f64::INFINITY);
        assert_eq!(at(1.5), 4.0);
        assert_eq!(at(3.0), 3.0);
        assert_eq!(at(8.0), 2.0);
        assert_eq!(at(9.0), f64::INFINITY);
    }

    #[test]
    fn nothing_appears_inside_the_robot() {
        let mut world = world(
            "[[simulation.thing]]\nfrom_s = 1\nshape.box = [{ at = [1, 0], size_m = [1, 1] }]",
        );
        world.advance(2.0, DVec2::new(1.0, 0.0), 0.1);
        assert_eq!(world.clearance(DVec2::ZERO), f64::INFINITY, "it waits");
        world.advance(3.0, DVec2::new(0.0, 0.0), 0.1);
        assert_eq!(world.clearance(DVec2::ZERO), 0.5);
    }
}
