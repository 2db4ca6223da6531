//! Shapes of the world and of the a-priori map, in metres in the mission frame.

use glam::DVec2;

words! {
    #[derive(Default)]
    Light {
        /// Scatters the beam: a laser detects it from any side.
        #[default]
        Matt,
        /// Transmits the beam, except near the normal, where it reflects it back into the laser.
        Glass,
        /// Scatters a tenth of the light: a laser detects it at short range.
        Black,
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    pub bottom_m: f64,
    /// Infinite for a shape higher than any robot.
    pub top_m: f64,
    /// Echo strength relative to a hard thing.
    pub echo: f64,
    pub light: Light,
}

impl Profile {
    /// Returns the vertical distance to the shape, metres; 0 at a height that it covers.
    pub fn height_gap(&self, height_m: f64) -> f64 {
        (self.bottom_m - height_m).max(height_m - self.top_m).max(0.0)
    }

    pub fn is_between(&self, lower_m: f64, upper_m: f64) -> bool {
        self.bottom_m < upper_m && self.top_m > lower_m
    }
}

/// Declares a shape: its outline from above, and the keys of a [`Profile`].
macro_rules! shape {
    (
        $(#[$about:meta])*
        $name:ident { $($(#[$doc:meta])* $field:ident: $type:ty,)* }
    ) => {
        rows! {
            #[derive(Default)]
            $(#[$about])*
            $name {
                $($(#[$doc])* $field: $type,)*
                bottom_m: Option<f64>,
                top_m: Option<f64>,
                echo: Option<f64>,
                light: Option<Light>,
            }
        }

        impl $name {
            pub fn profile(&self) -> Profile {
                Profile {
                    bottom_m: self.bottom_m.unwrap_or(0.0),
                    top_m: self.top_m.unwrap_or(f64::INFINITY),
                    echo: self.echo.unwrap_or(1.0),
                    light: self.light.unwrap_or_default(),
                }
            }
        }
    };
}

shape! {
    /// Disc: a cable drum, a post, or the leg of a table or chair (a radius of 0.01 to 0.015 m).
    Drum {
        at: DVec2,
        radius_m: f64,
    }
}

shape! {
    /// Wall: a polyline without thickness.
    Wall {
        points: Vec<DVec2>,
    }
}

shape! {
    /// Rectangle: a crate, desk or cabinet.
    Box2 {
        at: DVec2,
        /// Extent along its own two axes.
        size_m: DVec2,
        /// Counter-clockwise.
        #[serde(default)]
        angle_deg: f64,
    }
}

impl Wall {
    pub fn edges(&self) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
        self.points.windows(2).map(|pair| (pair[0], pair[1]))
    }
}

impl Box2 {
    /// Counter-clockwise.
    pub fn corners(&self) -> [DVec2; 4] {
        let axis = DVec2::from_angle(self.angle_deg.to_radians());
        let half = self.size_m / 2.0;
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(a, b)| self.at + axis.rotate(half * DVec2::new(a, b)))
    }

    pub fn edges(&self) -> impl Iterator<Item = (DVec2, DVec2)> + use<> {
        let corners = self.corners();
        (0..4).map(move |side| (corners[side], corners[(side + 1) % 4]))
    }
}

rows! {
    /// Keep-out polygon.
    #[derive(Default)]
    Zone {
        points: Vec<DVec2>,
    }
}

impl Zone {
    /// Returns the distance to its edge, metres; negative inside.
    pub fn clearance(&self, point: DVec2) -> f64 {
        let mut nearest = f64::INFINITY;
        let mut is_inside = false;
        for (from, to) in ring(&self.points) {
            nearest = nearest.min(distance_to_segment(point, from, to));
            let way = to - from;
            let crosses = (from.y > point.y) != (to.y > point.y)
                && point.x < from.x + way.x * (point.y - from.y) / way.y;
            is_inside ^= crosses;
        }
        if is_inside { -nearest } else { nearest }
    }

    pub fn crosses_itself(&self) -> bool {
        let side = |(from, to): (DVec2, DVec2), at: DVec2| (to - from).perp_dot(at - from);
        let splits = |line, (from, to)| side(line, from) * side(line, to) < 0.0;
        let crosses = |one, other| splits(one, other) && splits(other, one);
        ring(&self.points).any(|one| ring(&self.points).any(|other| crosses(one, other)))
    }
}

keys! {
    Shapes {
        #[serde(rename = "drum")]
        drums: Vec<Drum>,
        #[serde(rename = "wall")]
        walls: Vec<Wall>,
        #[serde(rename = "box")]
        boxes: Vec<Box2>,
    }
}

impl Shapes {
    pub fn is_empty(&self) -> bool {
        self.drums.is_empty() && self.walls.is_empty() && self.boxes.is_empty()
    }

    pub fn edges(&self) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
        self.walls.iter().flat_map(Wall::edges).chain(self.boxes.iter().flat_map(Box2::edges))
    }

    pub fn pieces(&self) -> impl Iterator<Item = Piece<'_>> + '_ {
        let walls = self.walls.iter().flat_map(Wall::edges);
        let walls = walls.map(|(from, to)| Piece::Edge(from, to));
        self.drums.iter().map(Piece::Drum).chain(walls).chain(self.boxes.iter().map(Piece::Box))
    }

    /// Returns the least and greatest corner of all shapes and two points.
    pub fn bounds_with(&self, one: DVec2, other: DVec2) -> (DVec2, DVec2) {
        let points = (one.min(other), one.max(other));
        self.pieces()
            .map(|piece| piece.bounds())
            .fold(points, |(least, greatest), (from, to)| (least.min(from), greatest.max(to)))
    }

    /// Returns the shapes that a body between two heights, metres, can touch.
    pub fn between(&self, lower_m: f64, upper_m: f64) -> Self {
        let mut shapes = self.clone();
        let meets = |profile: Profile| profile.is_between(lower_m, upper_m);
        shapes.drums.retain(|drum| meets(drum.profile()));
        shapes.walls.retain(|wall| meets(wall.profile()));
        shapes.boxes.retain(|block| meets(block.profile()));
        shapes
    }

    /// Returns the distance to the nearest surface, metres: negative inside drums and boxes,
    /// infinite without shapes.
    pub fn clearance(&self, point: DVec2) -> f64 {
        self.pieces().map(|piece| piece.clearance(point)).fold(f64::INFINITY, f64::min)
    }
}

#[derive(Clone, Copy, Debug)]
pub enum Piece<'a> {
    Drum(&'a Drum),
    Edge(DVec2, DVec2),
    Box(&'a Box2),
    Zone(&'a Zone),
}

impl Piece<'_> {
    /// Returns the distance to its surface, metres; negative inside.
    pub fn clearance(&self, point: DVec2) -> f64 {
        match self {
            Self::Drum(drum) => drum.at.distance(point) - drum.radius_m,
            Self::Edge(from, to) => distance_to_segment(point, *from, *to),
            Self::Box(block) => {
                let axis = DVec2::from_angle(-block.angle_deg.to_radians());
                let local = axis.rotate(point - block.at).abs() - block.size_m / 2.0;
                local.max(DVec2::ZERO).length() + local.max_element().min(0.0)
            }
            Self::Zone(zone) => zone.clearance(point),
        }
    }

    pub fn bounds(&self) -> (DVec2, DVec2) {
        match self {
            Self::Drum(drum) => (drum.at - drum.radius_m, drum.at + drum.radius_m),
            Self::Edge(from, to) => (from.min(*to), from.max(*to)),
            Self::Box(block) => bounds(&block.corners()),
            Self::Zone(zone) => bounds(&zone.points),
        }
    }
}

fn bounds(corners: &[DVec2]) -> (DVec2, DVec2) {
    let nothing = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    let wider =
        |(least, most): (DVec2, DVec2), corner: &DVec2| (least.min(*corner), most.max(*corner));
    corners.iter().fold(nothing, wider)
}

pub(crate) fn ring(corners: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
    corners.iter().zip(corners.iter().cycle().skip(1)).map(|(from, to)| (*from, *to))
}

pub fn distance_to_segment(point: DVec2, from: DVec2, to: DVec2) -> f64 {
    nearest_on_segment(point, from, to).distance(point)
}

pub fn nearest_on_segment(point: DVec2, from: DVec2, to: DVec2) -> DVec2 {
    let along = to - from;
    let length_squared = along.length_squared();
    if length_squared == 0.0 {
        return from;
    }
    from + along * ((point - from).dot(along) / length_squared).clamp(0.0, 1.0)
}

/// Returns the standard deviations along the principal axes of the position covariance
/// `[xx, xy, yy]`, and the major axis's angle from x, radians.
pub fn principal_axes([xx, xy, yy]: [f64; 3]) -> ([f64; 2], f64) {
    let mean = 0.5 * (xx + yy);
    let half = 0.5 * (xx - yy);
    let variances = [mean + half.hypot(xy), mean - half.hypot(xy)];
    (variances.map(|variance| variance.max(0.0).sqrt()), 0.5 * xy.atan2(half))
}

/// Returns the symmetric matrix with this upper triangle; both are row by row.
pub const fn symmetric([xx, xy, xt, yy, yt, tt]: [f64; 6]) -> [[f64; 3]; 3] {
    [[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]]
}

/// To (-pi, pi], radians.
pub fn wrap_angle(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    let turned = angle.rem_euclid(TAU);
    let wrapped = if turned > PI { turned - TAU } else { turned };
    debug_assert!(wrapped.abs() <= PI || wrapped.is_nan());
    wrapped
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::close;

    #[test]
    fn clearance_is_to_the_surface_and_negative_inside() {
        let text = "drum = [{ at = [2, 0], radius_m = 0.5 }]\n\
            wall = [{ points = [[-1, -3], [-1, 3]] }]\n\
            box = [{ at = [0, 4], size_m = [2, 1], angle_deg = 90 }]";
        let shapes: Shapes = toml::from_str(text).unwrap();
        for (x, y, clearance) in [
            // The wall is nearest, then the drum, at last from within.
            (0.0, 0.0, 1.0),
            (1.0, 0.0, 0.5),
            (2.0, 0.0, -0.5),
            // The turned box is 2 m tall.
            (0.0, 2.5, 0.5),
            (0.0, 4.0, -0.5),
        ] {
            close(shapes.clearance(DVec2::new(x, y)), clearance);
        }
        assert_eq!(Shapes::default().clearance(DVec2::ZERO), f64::INFINITY);
    }

    #[test]
    fn the_clearance_of_a_zone_is_negative_inside_of_any_polygon() {
        let points = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (2.0, 1.0), (0.0, 4.0)];
        let mut zone = Zone { points: points.map(DVec2::from).to_vec() };
        for _ in 0..2 {
            assert_eq!(zone.clearance(DVec2::new(1.0, 0.5)), -0.5);
            assert_eq!(zone.clearance(DVec2::new(-2.0, 1.0)), 2.0);
            // In the notch, and in a horn.
            assert!(zone.clearance(DVec2::new(2.0, 3.0)) > 0.5);
            assert!(zone.clearance(DVec2::new(3.8, 3.5)) < 0.0);
            zone.points.reverse();
        }
        let (least, greatest) = Piece::Zone(&zone).bounds();
        assert_eq!((least, greatest), (DVec2::ZERO, DVec2::splat(4.0)));
    }
}
