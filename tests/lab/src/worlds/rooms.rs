//! Rooms: four walls, drums, boxes and loose walls at any angle, at three densities; in one of three a partition with
//! a door of 0.8 to 1.2 m. Rotated rooms lie at any angle to the grid, and their partitions at an angle to the walls.
//! Glazed rooms have partitions and cabinets of glass, and black things.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use common::geometry::{Box2, Drum, Light, Shapes, Wall};
use glam::DVec2;

use crate::{missions::trial::Scene, random::Random};

/// Things per square metre of floor: sparse, usual, dense.
const DENSITIES: [f64; 3] = [0.10, 0.18, 0.26];
/// Free distance around start and target, metres.
const KEPT_FREE_M: f64 = 0.5;
const DOOR_SHARE: f64 = 1.0 / 3.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doors {
    /// One room in three has a partition with a door.
    Some,
    All,
}

/// Greatest angle between an oblique partition and the walls that it would be parallel to, degrees.
const MOST_OBLIQUE_DEG: f64 = 35.0;

/// Room `number`. The number selects the density.
pub fn draw(random: &mut Random, number: usize, doors: Doors) -> Scene {
    room(random, number, doors, false)
}

/// Room `number` with an oblique partition, rotated against the grid.
pub fn rotated(random: &mut Random, number: usize, doors: Doors) -> Scene {
    let mut scene = room(random, number, doors, true);
    let angle = random.within(-PI, PI);
    let turn = |at: &mut DVec2| *at = DVec2::from_angle(angle).rotate(*at);
    let Shapes { drums, boxes, walls } = &mut scene.shapes;
    drums.iter_mut().for_each(|drum| turn(&mut drum.at));
    walls.iter_mut().flat_map(|wall| &mut wall.points).for_each(turn);
    for block in boxes {
        turn(&mut block.at);
        block.angle_deg = (block.angle_deg + angle.to_degrees()).rem_euclid(180.0);
    }
    turn(&mut scene.target);
    scene.heading = (scene.heading + angle + PI).rem_euclid(TAU) - PI;
    scene
}

/// Room `number` with a partition. It and the loose walls are of glass; one box in three is of glass, a display cabinet, and one is black;
/// one drum in three is black.
pub fn glazed(random: &mut Random, number: usize) -> Scene {
    let mut scene = room(random, number, Doors::All, false);
    let Shapes { drums, boxes, walls } = &mut scene.shapes;
    // The first wall encloses the room.
    walls.iter_mut().skip(1).for_each(|wall| wall.light = Some(Light::Glass));
    let (glass, black) = (Some(Light::Glass), Some(Light::Black));
    boxes.iter_mut().for_each(|block| block.light = [None, glass, black][random.below(3)]);
    drums.iter_mut().for_each(|drum| drum.light = [None, None, black][random.below(3)]);
    scene
}

fn room(random: &mut Random, number: usize, doors: Doors, oblique: bool) -> Scene {
    let distance = random.within(4.0, 8.0);
    let half_width = random.within(1.6, 3.0);
    let target = DVec2::new(distance, random.within(-0.5, 0.5) * half_width);
    let (least, greatest) = (DVec2::new(-1.2, -half_width), DVec2::new(distance + 1.2, half_width));
    let mut shapes = Shapes { walls: vec![closed(least, greatest)], ..Shapes::default() };
    if doors == Doors::All || random.share() < DOOR_SHARE {
        let at = random.within(1.2, distance - 1.2);
        let gap = random.within(0.8, 1.2);
        let reach = half_width - gap / 2.0 - 0.1;
        let middle = random.within(-reach, reach);
        let most = if oblique { MOST_OBLIQUE_DEG } else { 0.0 };
        // The thing stays clear of start and target.
        let most = most
            .min((0.7 * (at.min(distance - at) - KEPT_FREE_M) / half_width).atan().to_degrees());
        let slant = if oblique { random.within(-most, most).to_radians().tan() } else { 0.0 };
        partition(&mut shapes, at, slant, middle, gap, half_width);
    }
    let extent = greatest - least;
    let things = (extent.x * extent.y * DENSITIES[number % DENSITIES.len()]).round() as usize;
    for _ in 0..things {
        let at = random.point((least + greatest) / 2.0, extent / 2.0);
        add_thing(&mut shapes, random, at, target);
    }
    let heading = match random.below(4) {
        0 => 0.0,
        1 => FRAC_PI_2,
        2 => PI,
        _ => random.within(-PI, PI),
    };
    Scene { shapes, things: Vec::new(), start: DVec2::ZERO, heading, target }
}

pub fn closed(least: DVec2, greatest: DVec2) -> Wall {
    let corners =
        [least, DVec2::new(greatest.x, least.y), greatest, DVec2::new(least.x, greatest.y), least];
    Wall { points: corners.to_vec(), ..Wall::default() }
}

/// A wall across the room through (`at`, 0), which leads `slant` metres along x for each along y, with a door of `gap` metres around
/// y = `middle`.
fn partition(shapes: &mut Shapes, at: f64, slant: f64, middle: f64, gap: f64, half_width: f64) {
    let half_gap = gap / 2.0 / slant.hypot(1.0);
    for (from, to) in [(-half_width, middle - half_gap), (middle + half_gap, half_width)] {
        shapes.walls.push(Wall {
            points: [from, to].map(|y| DVec2::new(at + slant * y, y)).to_vec(),
            ..Wall::default()
        });
    }
}

/// Add a drum, a box or a loose wall at `at`, or nothing if start or target would not be free.
fn add_thing(shapes: &mut Shapes, random: &mut Random, at: DVec2, target: DVec2) {
    let is_free =
        |reach: f64| at.length() > reach + KEPT_FREE_M && at.distance(target) > reach + KEPT_FREE_M;
    match random.below(10) {
        0..=4 => {
            let radius_m = random.within(0.12, 0.35);
            if is_free(radius_m) {
                shapes.drums.push(Drum { at, radius_m, ..Drum::default() });
            }
        }
        5..=7 => {
            let size_m = DVec2::new(random.within(0.24, 0.8), random.within(0.24, 0.8));
            let angle_deg = random.within(0.0, 180.0);
            if is_free(size_m.length() / 2.0) {
                shapes.boxes.push(Box2 { at, size_m, angle_deg, ..Box2::default() });
            }
        }
        _ => {
            let half = random.within(0.4, 1.1);
            let along = DVec2::from_angle(random.within(0.0, TAU)) * half;
            if is_free(half) {
                shapes.walls.push(Wall { points: vec![at - along, at + along], ..Wall::default() });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glazed_rooms_have_glass_inside_their_walls_and_some_black_things() {
        let (mut cabinets, mut black) = (0, 0);
        for number in 0..20 {
            let Shapes { drums, boxes, walls } =
                glazed(&mut Random::of_world(1, 10, number), 1).shapes;
            assert_eq!(walls[0].light, None);
            assert!(
                walls.len() > 2 && walls[1..].iter().all(|wall| wall.light == Some(Light::Glass))
            );
            cabinets += boxes.iter().filter(|block| block.light == Some(Light::Glass)).count();
            let lights = drums.iter().map(|it| it.light).chain(boxes.iter().map(|it| it.light));
            black += lights.filter(|light| *light == Some(Light::Black)).count();
        }
        assert!(cabinets >= 5 && black >= 10, "{cabinets} cabinets, {black} black things");
    }
}
