//! U traps across the straight path: of walls and of drums, of several depths and widths, with any heading of the robot.

use common::geometry::{Drum, Shapes, Wall};
use glam::DVec2;

use crate::{missions::trial::Scene, random::Random};

/// Distance from the start to the bottom of the U, metres.
const BOTTOM_M: f64 = 2.4;
/// Gap between drums, metres, which a body does not pass.
const DRUM_SPACING_M: f64 = 0.36;
const DRUM_RADIUS_M: f64 = 0.17;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    Walls,
    Drums,
}

/// Trap `number`. The number selects the sides and the robot's heading, in steps of 45 degrees.
pub fn draw(random: &mut Random, number: usize) -> Scene {
    let sides = [Sides::Walls, Sides::Drums][number % 2];
    let heading_deg = 45.0 * (number / 2 % 8) as f64;
    let depth = random.within(0.8, 1.6);
    let half_width = random.within(0.7, 1.3);
    let off = random.within(-0.3, 0.3);
    let corners = [
        DVec2::new(BOTTOM_M - depth, off - half_width),
        DVec2::new(BOTTOM_M, off - half_width),
        DVec2::new(BOTTOM_M, off + half_width),
        DVec2::new(BOTTOM_M - depth, off + half_width),
    ];
    let mut shapes = Shapes::default();
    match sides {
        Sides::Walls => shapes.walls.push(Wall { points: corners.to_vec(), ..Wall::default() }),
        Sides::Drums => {
            for pair in corners.windows(2) {
                let steps = (pair[0].distance(pair[1]) / DRUM_SPACING_M).ceil();
                shapes.drums.extend((0..=steps as u32).map(|step| Drum {
                    at: pair[0].lerp(pair[1], f64::from(step) / steps),
                    radius_m: DRUM_RADIUS_M,
                    ..Drum::default()
                }));
            }
        }
    }
    Scene {
        shapes,
        things: Vec::new(),
        start: DVec2::ZERO,
        heading: f64::to_radians(heading_deg),
        target: DVec2::new(4.5, 0.0),
    }
}
