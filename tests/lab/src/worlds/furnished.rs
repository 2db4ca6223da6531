//! Rooms with furniture: tables and chairs on legs 2 to 3 cm thick, low platforms, overhanging
//! shelves, soft sofas and curtains. Heights and echoes determine sonar detections and contacts.

use std::f64::consts::{FRAC_PI_2, PI};

use common::geometry::{Box2, Drum, Shapes, Wall};
use glam::DVec2;

use super::shapes::{Room, block, boxes, heading, walls};
use simulation::Random;

use crate::missions::trial::Scene;

/// Objects per square metre of floor: sparse, usual, dense.
const DENSITIES: [f64; 3] = [0.10, 0.16, 0.22];
const KEPT_FREE_M: f64 = 0.5;
/// Echo amplitude of cloth, relative to a hard surface.
const SOFT: f64 = 0.1;
const BEHIND_CURTAIN_M: f64 = 0.12;

/// Draws room `number`, which selects the density.
pub fn draw(random: &mut Random, number: usize) -> Scene {
    let room = Room::draw(random, 7.0, [2.0, 3.0]);
    let Room { target, least, greatest } = room;
    let mut shapes = walls([room.closed()]);
    if random.chance(0.5) {
        shapes.walls.push(curtain(random, least, greatest));
    }
    let mut taken: Vec<(DVec2, f64)> = Vec::new();
    for _ in 0..room.things(DENSITIES[number % DENSITIES.len()]) {
        let at = room.place(random);
        let (thing, reach) = thing(random, at);
        let ends_free = thing.clearance(DVec2::ZERO).min(thing.clearance(target)) > KEPT_FREE_M;
        // Corners may be in a wall, because furniture stands against it.
        let (from, to) = (at - 0.7 * reach, at + 0.7 * reach);
        let inside = from.cmpge(least).all() && to.cmple(greatest).all();
        // Furniture may touch, and chairs may stand below tables; walls limit it.
        let meets = |other: &(DVec2, f64)| at.distance(other.0) < 0.8 * (reach + other.1);
        if ends_free && inside && !taken.iter().any(meets) {
            taken.push((at, reach));
            shapes.drums.extend(thing.drums);
            shapes.boxes.extend(thing.boxes);
        }
    }
    Scene { shapes, heading: heading(random, 3, 0.0), target, ..Scene::default() }
}

fn thing(random: &mut Random, at: DVec2) -> (Shapes, f64) {
    let angle = match random.below(3) {
        0 => random.within(0.0, PI),
        _ => [0.0, FRAC_PI_2][random.below(2)],
    };
    let kind = random.below(10);
    let size_m = match kind {
        0..=3 => DVec2::splat(random.within(0.40, 0.48)),
        4..=5 => DVec2::new(random.within(1.1, 1.6), random.within(0.7, 0.9)),
        6 => DVec2::new(random.within(0.7, 1.1), random.within(0.5, 0.7)),
        7..=8 => DVec2::new(random.within(0.3, 0.9), random.within(0.3, 0.7)),
        _ => DVec2::new(random.within(1.3, 1.8), random.within(0.7, 0.9)),
    };
    let block = block(at, size_m, angle.to_degrees());
    let shapes = match kind {
        // Seats and table tops are above the robot.
        0..=3 => on_legs(random, &block, 0.42, 0.47),
        4..=5 => on_legs(random, &block, 0.70, 0.74),
        // The shelf of a low table is above the sonar and below the robot's top.
        6 => {
            let bottom = random.within(0.20, 0.24);
            on_legs(random, &block, bottom, bottom + 0.02)
        }
        // A step or lamp foot is below the sonar.
        7..=8 => boxes([Box2 { top_m: Some(random.within(0.05, 0.10)), ..block }]),
        _ => boxes([Box2 { top_m: Some(0.8), echo: Some(SOFT), ..block }]),
    };
    (shapes, size_m.length() / 2.0)
}

/// Puts `top` between two heights, metres, on four corner legs 2 to 3 cm thick.
fn on_legs(random: &mut Random, top: &Box2, bottom_m: f64, top_m: f64) -> Shapes {
    let radius_m = random.within(0.010, 0.015);
    let middle = top.at;
    let legs = top.corners().map(|corner| Drum {
        at: corner + (middle - corner).normalize_or_zero() * 2.0 * radius_m,
        radius_m,
        top_m: Some(bottom_m),
        ..Drum::default()
    });
    Shapes {
        drums: legs.to_vec(),
        ..boxes([Box2 { bottom_m: Some(bottom_m), top_m: Some(top_m), ..top.clone() }])
    }
}

fn curtain(random: &mut Random, least: DVec2, greatest: DVec2) -> Wall {
    let y = match random.below(2) {
        0 => least.y + BEHIND_CURTAIN_M,
        _ => greatest.y - BEHIND_CURTAIN_M,
    };
    let width = random.within(1.0, 2.5);
    let from = random.within(least.x, greatest.x - width);
    Wall {
        points: vec![DVec2::new(from, y), DVec2::new(from + width, y)],
        echo: Some(SOFT),
        ..Wall::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rooms_have_legs_tops_over_and_in_the_body_low_things_and_soft_ones() {
        let scenes: Vec<Scene> = (0..30)
            .map(|number| draw(&mut Random::of_world(1, 6, number), number as usize))
            .collect();
        let boxes: Vec<&Box2> = scenes.iter().flat_map(|it| &it.shapes.boxes).collect();
        let count = |is: &dyn Fn(&Box2) -> bool| boxes.iter().filter(|it| is(it)).count();
        let (sonar_m, body_top_m) = (0.18, 0.255);
        let over = count(&|it| it.profile().bottom_m > body_top_m);
        let overhanging = count(&|it| (sonar_m..body_top_m).contains(&it.profile().bottom_m));
        let low = count(&|it| it.profile().top_m < sonar_m);
        let soft = count(&|it| it.profile().echo == SOFT);
        let curtains = scenes.iter().flat_map(|it| &it.shapes.walls);
        let curtains = curtains.filter(|wall| wall.echo == Some(SOFT)).count();
        let numbers = [over, overhanging, low, soft, curtains];
        assert!(numbers.iter().all(|number| *number >= 5), "{numbers:?}");
        let legs: Vec<&Drum> = scenes.iter().flat_map(|it| &it.shapes.drums).collect();
        assert_eq!(legs.len(), 4 * (over + overhanging));
        assert!(legs.iter().all(|leg| (0.010..=0.015).contains(&leg.radius_m)));
    }
}
