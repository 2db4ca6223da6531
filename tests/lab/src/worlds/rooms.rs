//! Rooms with four walls, and drums, boxes and loose walls at any angle, at three densities. One in
//! three has a partition with a door of 0.8 to 1.2 m.
//!
//! Rotated rooms are at any angle to the grid, and their partitions at an angle to the walls.
//! Glazed rooms have partitions and cabinets of glass, and black objects.
//!
//! In rooms for a meeting, two robots pass a doorway in opposite directions, each starting at the
//! other's target.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use common::geometry::{Light, Shapes, Wall};
use glam::DVec2;

use super::shapes::{Room, block, drum, heading, wall, walls};
use simulation::Random;

use crate::missions::trial::{Scene, points};

/// Objects per square metre of floor: sparse, usual, dense.
const DENSITIES: [f64; 3] = [0.10, 0.18, 0.26];
const KEPT_FREE_M: f64 = 0.5;
const DOOR_SHARE: f64 = 1.0 / 3.0;
const DOORS_M: [f64; 2] = [0.8, 1.2];

/// Doors of a meeting; through a narrow one robots pass one after the other.
const MEETING_DOORS_M: [f64; 2] = [0.8, 1.8];
const MEETING_DENSITY: f64 = 0.06;
/// Free distance of drums around start and target, and of the doorway from them.
const MEETING_KEPT_FREE_M: f64 = 0.6;
const MEETING_DOOR_FROM_ENDS_M: f64 = 1.5;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doors {
    /// Partition with a door in one of three rooms.
    Some,
    All,
}

const MOST_OBLIQUE_DEG: f64 = 35.0;

pub fn draw(random: &mut Random, number: usize, doors: Doors) -> Scene {
    room(random, number, doors, false)
}

pub fn rotated(random: &mut Random, number: usize, doors: Doors) -> Scene {
    let mut scene = room(random, number, doors, true);
    let angle = random.within(-PI, PI);
    let target = std::iter::once(&mut scene.target);
    for at in points(&mut scene.shapes).chain(target) {
        *at = DVec2::from_angle(angle).rotate(*at);
    }
    for block in &mut scene.shapes.boxes {
        block.angle_deg = (block.angle_deg + angle.to_degrees()).rem_euclid(180.0);
    }
    scene.heading = (scene.heading + angle + PI).rem_euclid(TAU) - PI;
    scene
}

/// Draws room `number` with a partition. Partition and loose walls are glass. One box in three is
/// glass, a display cabinet, and one black; one drum in three is black.
pub fn glazed(random: &mut Random, number: usize) -> Scene {
    let mut scene = room(random, number, Doors::All, false);
    let Shapes { drums, boxes, walls } = &mut scene.shapes;
    walls.iter_mut().skip(1).for_each(|wall| wall.light = Some(Light::Glass));
    let (glass, black) = (Some(Light::Glass), Some(Light::Black));
    boxes.iter_mut().for_each(|block| block.light = [None, glass, black][random.below(3)]);
    drums.iter_mut().for_each(|drum| drum.light = [None, None, black][random.below(3)]);
    scene
}

pub fn meeting(random: &mut Random) -> Scene {
    let room = Room::draw(random, 8.0, [1.6, 3.0]);
    let target = room.target;
    let from_ends = MEETING_DOOR_FROM_ENDS_M;
    let x = random.within(from_ends, target.x - from_ends);
    let door = door(random, &room, MEETING_DOORS_M);
    let mut shapes = room.with_drums(random, MEETING_DENSITY, MEETING_KEPT_FREE_M);
    shapes.walls.extend(partition(&room, x, door, 0.0));
    let [ahead, oncoming] = [0.0, PI].map(|usual| heading(random, 4, usual));
    Scene { shapes, heading: ahead, target, oncoming: Some(oncoming), ..Scene::default() }
}

/// Draws the middle and the width of a door in a partition.
fn door(random: &mut Random, room: &Room, widths: [f64; 2]) -> [f64; 2] {
    let gap = random.in_range(widths);
    let reach = room.greatest.y - gap / 2.0 - 0.1;
    [random.within(-reach, reach), gap]
}

/// Returns a partition through (`x`, 0) with `slant` metres in x per metre in y, and a door.
fn partition(room: &Room, x: f64, [middle, gap]: [f64; 2], slant: f64) -> [Wall; 2] {
    let (half_width, half_gap) = (room.greatest.y, gap / 2.0 / slant.hypot(1.0));
    [[-half_width, middle - half_gap], [middle + half_gap, half_width]]
        .map(|ends| wall(ends.map(|y| DVec2::new(x + slant * y, y))))
}

fn room(random: &mut Random, number: usize, doors: Doors, oblique: bool) -> Scene {
    let room = Room::draw(random, 8.0, [1.6, 3.0]);
    let target = room.target;
    let mut shapes = walls([room.closed()]);
    if doors == Doors::All || random.chance(DOOR_SHARE) {
        let at = random.within(1.2, target.x - 1.2);
        let door = door(random, &room, DOORS_M);
        let mut slant = 0.0;
        if oblique {
            let most = (0.7 * (at.min(target.x - at) - KEPT_FREE_M) / room.greatest.y).atan();
            let most = MOST_OBLIQUE_DEG.min(most.to_degrees());
            slant = random.within(-most, most).to_radians().tan();
        }
        shapes.walls.extend(partition(&room, at, door, slant));
    }
    for _ in 0..room.things(DENSITIES[number % DENSITIES.len()]) {
        let at = room.place(random);
        add_thing(&mut shapes, random, at, target);
    }
    let heading = match random.below(4) {
        0 => 0.0,
        1 => FRAC_PI_2,
        2 => PI,
        _ => random.within(-PI, PI),
    };
    Scene { shapes, heading, target, ..Scene::default() }
}

/// Adds an object at `at`, unless it would obstruct start or target.
fn add_thing(shapes: &mut Shapes, random: &mut Random, at: DVec2, target: DVec2) {
    let nearest_m = at.length().min(at.distance(target));
    let is_free = |reach: f64| nearest_m > reach + KEPT_FREE_M;
    match random.below(10) {
        0..=4 => {
            let radius_m = random.within(0.12, 0.35);
            shapes.drums.extend(is_free(radius_m).then(|| drum(at, radius_m)));
        }
        5..=7 => {
            let size_m = DVec2::new(random.within(0.24, 0.8), random.within(0.24, 0.8));
            let angle_deg = random.within(0.0, 180.0);
            let free = is_free(size_m.length() / 2.0);
            shapes.boxes.extend(free.then(|| block(at, size_m, angle_deg)));
        }
        _ => {
            let half = random.within(0.4, 1.1);
            let along = DVec2::from_angle(random.within(0.0, TAU)) * half;
            shapes.walls.extend(is_free(half).then(|| wall([at - along, at + along])));
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
