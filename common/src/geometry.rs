//! The shapes a mission is written in: what stands in a world, and what is known of it beforehand.
//!
//! Metres, in the mission frame (origin where the robot starts).

use glam::DVec2;
use serde::{Deserialize, Serialize};

/// A cable drum: a disc.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drum {
    /// Centre, metres.
    pub at: DVec2,
    /// Radius, metres.
    pub radius_m: f64,
}

/// A wall: a polyline without thickness.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wall {
    /// Corners in order, metres; at least two.
    pub points: Vec<DVec2>,
}

/// A crate, desk or cabinet: a rectangle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Box2 {
    /// Centre, metres.
    pub at: DVec2,
    /// Full extent along its own two axes, metres.
    pub size_m: DVec2,
    /// Counter-clockwise turn of its first axis, degrees.
    #[serde(default)]
    pub angle_deg: f64,
}

impl Box2 {
    /// The four corners, counter-clockwise.
    #[must_use]
    pub fn corners(&self) -> [DVec2; 4] {
        let axis = DVec2::from_angle(self.angle_deg.to_radians());
        let half = self.size_m / 2.0;
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(a, b)| self.at + axis.rotate(half * DVec2::new(a, b)))
    }
}

/// Things that stand somewhere.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Shapes {
    /// Discs.
    #[serde(rename = "drum")]
    pub drums: Vec<Drum>,
    /// Polylines.
    #[serde(rename = "wall")]
    pub walls: Vec<Wall>,
    /// Rectangles.
    #[serde(rename = "box")]
    pub boxes: Vec<Box2>,
}

impl Shapes {
    /// Whether nothing stands here.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.drums.is_empty() && self.walls.is_empty() && self.boxes.is_empty()
    }

    /// Every straight edge of walls and boxes, as (from, to).
    pub fn edges(&self) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
        let walls = self
            .walls
            .iter()
            .flat_map(|wall| wall.points.windows(2).map(|pair| (pair[0], pair[1])));
        let boxes = self.boxes.iter().flat_map(|block| {
            let corners = block.corners();
            (0..4).map(move |side| (corners[side], corners[(side + 1) % 4]))
        });
        walls.chain(boxes)
    }

    /// Everything that stands here, one by one.
    pub fn pieces(&self) -> impl Iterator<Item = Piece<'_>> + '_ {
        let walls = self.walls.iter().flat_map(|wall| {
            wall.points
                .windows(2)
                .map(|pair| Piece::Edge(pair[0], pair[1]))
        });
        self.drums
            .iter()
            .map(Piece::Drum)
            .chain(walls)
            .chain(self.boxes.iter().map(Piece::Box))
    }

    /// Distance from `point` to the nearest surface, metres; negative inside a drum or a box,
    /// infinite where nothing stands.
    #[must_use]
    pub fn clearance(&self, point: DVec2) -> f64 {
        self.pieces()
            .map(|piece| piece.clearance(point))
            .fold(f64::INFINITY, f64::min)
    }
}

/// One thing: a drum, a straight edge of a wall, a box.
#[derive(Clone, Copy, Debug)]
pub enum Piece<'a> {
    /// A disc.
    Drum(&'a Drum),
    /// A straight edge.
    Edge(DVec2, DVec2),
    /// A rectangle.
    Box(&'a Box2),
}

impl Piece<'_> {
    /// Distance from `point` to its surface, metres; negative inside.
    #[must_use]
    pub fn clearance(&self, point: DVec2) -> f64 {
        match self {
            Self::Drum(drum) => drum.at.distance(point) - drum.radius_m,
            Self::Edge(from, to) => distance_to_segment(point, *from, *to),
            Self::Box(block) => {
                let axis = DVec2::from_angle(-block.angle_deg.to_radians());
                let local = axis.rotate(point - block.at).abs() - block.size_m / 2.0;
                local.max(DVec2::ZERO).length() + local.max_element().min(0.0)
            }
        }
    }

    /// The two corners, least and greatest, of an upright rectangle that contains it, metres.
    #[must_use]
    pub fn bounds(&self) -> (DVec2, DVec2) {
        match self {
            Self::Drum(drum) => {
                let reach = DVec2::splat(drum.radius_m);
                (drum.at - reach, drum.at + reach)
            }
            Self::Edge(from, to) => (from.min(*to), from.max(*to)),
            Self::Box(block) => {
                let reach = DVec2::splat(block.size_m.length() / 2.0);
                (block.at - reach, block.at + reach)
            }
        }
    }
}

/// Distance from `point` to the segment `from`..`to`, metres.
#[must_use]
pub fn distance_to_segment(point: DVec2, from: DVec2, to: DVec2) -> f64 {
    nearest_on_segment(point, from, to).distance(point)
}

/// The point of the segment `from`..`to` nearest to `point`.
#[must_use]
pub fn nearest_on_segment(point: DVec2, from: DVec2, to: DVec2) -> DVec2 {
    let along = to - from;
    let length_squared = along.length_squared();
    if length_squared == 0.0 {
        return from;
    }
    from + along * ((point - from).dot(along) / length_squared).clamp(0.0, 1.0)
}

/// `angle` brought into (-pi, pi], radians.
#[must_use]
pub fn wrap_angle(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    let turned = angle.rem_euclid(TAU);
    if turned > PI { turned - TAU } else { turned }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clearance_is_to_the_surface_and_negative_inside() {
        let shapes = Shapes {
            drums: vec![Drum {
                at: DVec2::new(2.0, 0.0),
                radius_m: 0.5,
            }],
            walls: vec![Wall {
                points: vec![DVec2::new(-1.0, -3.0), DVec2::new(-1.0, 3.0)],
            }],
            boxes: vec![Box2 {
                at: DVec2::new(0.0, 4.0),
                size_m: DVec2::new(2.0, 1.0),
                angle_deg: 90.0,
            }],
        };
        assert_eq!(shapes.clearance(DVec2::ZERO), 1.0, "the wall is nearest");
        assert_eq!(shapes.clearance(DVec2::new(1.0, 0.0)), 0.5, "the drum is");
        assert_eq!(shapes.clearance(DVec2::new(2.0, 0.0)), -0.5, "in the drum");
        let above = shapes.clearance(DVec2::new(0.0, 2.5));
        assert!(
            (above - 0.5).abs() < 1e-12,
            "the turned box is 2 m tall: {above}"
        );
        let inside = shapes.clearance(DVec2::new(0.0, 4.0));
        assert!((inside + 0.5).abs() < 1e-12, "inside the box: {inside}");
    }

    #[test]
    fn nothing_standing_is_infinitely_clear() {
        assert_eq!(Shapes::default().clearance(DVec2::ZERO), f64::INFINITY);
    }

    #[test]
    fn angles_wrap_to_the_half_open_turn() {
        use std::f64::consts::PI;
        assert!((wrap_angle(3.0 * PI) - PI).abs() < 1e-12);
        assert!((wrap_angle(-PI / 2.0) + PI / 2.0).abs() < 1e-12);
        assert!((wrap_angle(1.5 * PI) + PI / 2.0).abs() < 1e-12);
    }
}
