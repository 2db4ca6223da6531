//! Shapes of worlds, hard and higher than the robot.

use std::f64::consts::PI;

use common::geometry::{Box2, Drum, Shapes, Wall};
use glam::DVec2;

use simulation::Random;

pub fn drum(at: DVec2, radius_m: f64) -> Drum {
    Drum { at, radius_m, ..Drum::default() }
}

pub fn wall(points: impl Into<Vec<DVec2>>) -> Wall {
    Wall { points: points.into(), ..Wall::default() }
}

pub fn block(at: DVec2, size_m: DVec2, angle_deg: f64) -> Box2 {
    Box2 { at, size_m, angle_deg, ..Box2::default() }
}

pub fn walls(walls: impl Into<Vec<Wall>>) -> Shapes {
    Shapes { walls: walls.into(), ..Shapes::default() }
}

pub fn boxes(boxes: impl Into<Vec<Box2>>) -> Shapes {
    Shapes { boxes: boxes.into(), ..Shapes::default() }
}

pub fn drums(drums: impl Into<Vec<Drum>>) -> Shapes {
    Shapes { drums: drums.into(), ..Shapes::default() }
}

/// Closed room around a start at the origin and a target, with the corners of its floor.
pub struct Room {
    pub target: DVec2,
    pub least: DVec2,
    pub greatest: DVec2,
}

impl Room {
    /// Draws a room with a target 4 m to `farthest_m` along x, and half its width from a range.
    pub fn draw(random: &mut Random, farthest_m: f64, half_widths: [f64; 2]) -> Self {
        let distance = random.within(4.0, farthest_m);
        let half_width = random.in_range(half_widths);
        Self {
            target: DVec2::new(distance, random.within(-0.5, 0.5) * half_width),
            least: DVec2::new(-1.2, -half_width),
            greatest: DVec2::new(distance + 1.2, half_width),
        }
    }

    pub fn closed(&self) -> Wall {
        let Self { least, greatest, .. } = *self;
        let corners = [DVec2::new(greatest.x, least.y), DVec2::new(least.x, greatest.y)];
        wall([least, corners[0], greatest, corners[1], least])
    }

    pub fn things(&self, density: f64) -> usize {
        ((self.greatest - self.least).element_product() * density).round() as usize
    }

    pub fn with_drums(&self, random: &mut Random, density: f64, free_m: f64) -> Shapes {
        let mut shapes = walls([self.closed()]);
        for _ in 0..self.things(density) {
            let (at, radius_m) = (self.place(random), random.within(0.12, 0.35));
            let is_free = at.length().min(at.distance(self.target)) > radius_m + free_m;
            shapes.drums.extend(is_free.then(|| drum(at, radius_m)));
        }
        shapes
    }

    pub fn place(&self, random: &mut Random) -> DVec2 {
        random.point((self.least + self.greatest) / 2.0, (self.greatest - self.least) / 2.0)
    }
}

pub fn heading(random: &mut Random, n: usize, usual: f64) -> f64 {
    match random.below(n) {
        0 => random.within(-PI, PI),
        _ => usual,
    }
}
