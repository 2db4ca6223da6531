//! Corridors of smooth walls: straight ones from 0.8 m of width, and oblique ones with bends.

use std::f64::consts::PI;

use glam::DVec2;

use super::shapes::{heading, wall, walls};
use simulation::Random;

use crate::missions::trial::Scene;

pub fn straight(random: &mut Random) -> Scene {
    let length = random.within(4.0, 8.0);
    let width = random.within(0.8, 1.2);
    along(random, &[DVec2::ZERO, DVec2::new(length, 0.0)], width)
}

/// Draws two to four legs with bends of up to 50 degrees.
pub fn oblique(random: &mut Random) -> Scene {
    let width = random.within(1.0, 1.8);
    let mut axis = vec![DVec2::ZERO];
    let (mut at, mut angle) = (DVec2::ZERO, random.within(-PI, PI));
    for _ in 0..2 + random.below(3) {
        at += DVec2::from_angle(angle) * random.within(1.8, 3.0);
        axis.push(at);
        angle += random.within(-50.0, 50.0).to_radians();
    }
    along(random, &axis, width)
}

fn along(random: &mut Random, axis: &[DVec2], width: f64) -> Scene {
    let mut points = beside(axis, width / 2.0);
    points.extend(beside(axis, -width / 2.0).into_iter().rev());
    points.extend(points.first().copied());
    let last = axis.len() - 1;
    let back = (axis[last - 1] - axis[last]).normalize_or_zero();
    let ahead = (axis[1] - axis[0]).normalize_or_zero();
    Scene {
        shapes: walls([wall(points)]),
        start: axis[0] + ahead * 0.6,
        heading: heading(random, 3, ahead.to_angle()),
        target: axis[last] + back * 0.7,
        ..Scene::default()
    }
}

/// Returns the line at `by` to the left of `axis`, mitred at its corners.
fn beside(axis: &[DVec2], by: f64) -> Vec<DVec2> {
    let normal = |from: usize| (axis[from + 1] - axis[from]).perp().normalize_or_zero();
    (0..axis.len())
        .map(|index| {
            let before = normal(index.max(1) - 1);
            let after = normal(index.min(axis.len() - 2));
            let mitre = (before + after).normalize_or_zero();
            axis[index] + mitre * (by / mitre.dot(before).max(0.5))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walls_beside_a_bend_keep_the_width_of_the_corridor() {
        let axis = [DVec2::ZERO, DVec2::X, DVec2::new(1.0, 1.0)];
        assert_eq!(
            beside(&axis, 0.5),
            [DVec2::new(0.0, 0.5), DVec2::new(0.5, 0.5), DVec2::new(0.5, 1.0)]
        );
    }
}
