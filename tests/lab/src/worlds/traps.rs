//! U traps across the straight path: walls or drums, varying in depth, width and robot heading.

use glam::DVec2;

use super::shapes::{drum, drums, wall, walls};
use simulation::Random;

use crate::missions::trial::Scene;

/// Distance from the start to the bottom of the U.
const BOTTOM_M: f64 = 2.4;
/// Gap between drums, too narrow for a body.
const DRUM_SPACING_M: f64 = 0.36;
const DRUM_RADIUS_M: f64 = 0.17;

/// Draws trap `number`, which selects walls or drums, and the robot's heading in steps of 45
/// degrees.
pub fn draw(random: &mut Random, number: usize) -> Scene {
    let heading_deg = 45.0 * (number / 2 % 8) as f64;
    let depth = random.within(0.8, 1.6);
    let half_width = random.within(0.7, 1.3);
    let off = random.within(-0.3, 0.3);
    let corners = [(depth, -1.0), (0.0, -1.0), (0.0, 1.0), (depth, 1.0)]
        .map(|(out, side)| DVec2::new(BOTTOM_M - out, off + side * half_width));
    let shapes = if number.is_multiple_of(2) {
        walls([wall(corners)])
    } else {
        let sides = corners.windows(2).flat_map(|ends| {
            let steps = (ends[0].distance(ends[1]) / DRUM_SPACING_M).ceil();
            (0..=steps as u32).map(move |step| {
                drum(ends[0].lerp(ends[1], f64::from(step) / steps), DRUM_RADIUS_M)
            })
        });
        drums(sides.collect::<Vec<_>>())
    };
    let heading = heading_deg.to_radians();
    Scene { shapes, heading, target: DVec2::new(4.5, 0.0), ..Scene::default() }
}
