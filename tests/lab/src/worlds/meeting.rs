//! Two rooms joined by a doorway for two robots in opposite directions, each starting at the
//! other's target.

use std::f64::consts::PI;

use glam::DVec2;

use super::shapes::{Room, heading, wall};
use crate::{missions::trial::Scene, random::Random};

/// Through a narrow one robots pass one after the other.
const DOORS_M: [f64; 2] = [0.8, 1.8];
const DENSITY: f64 = 0.06;
/// Free distance of drums around start and target, and of the doorway from them.
const KEPT_FREE_M: f64 = 0.6;
const DOOR_FROM_ENDS_M: f64 = 1.5;

pub fn draw(random: &mut Random) -> Scene {
    let room = Room::draw(random, 8.0, [1.6, 3.0]);
    let (target, half_width) = (room.target, room.greatest.y);
    let x = random.within(DOOR_FROM_ENDS_M, target.x - DOOR_FROM_ENDS_M);
    let half_gap = random.within(DOORS_M[0], DOORS_M[1]) / 2.0;
    let reach = half_width - half_gap - 0.1;
    let middle = random.within(-reach, reach);
    let mut shapes = room.with_drums(random, DENSITY, KEPT_FREE_M);
    for ends in [[-half_width, middle - half_gap], [middle + half_gap, half_width]] {
        shapes.walls.push(wall(ends.map(|y| DVec2::new(x, y))));
    }
    let [ahead, oncoming] = [0.0, PI].map(|usual| heading(random, 4, usual));
    Scene { shapes, heading: ahead, target, oncoming: Some(oncoming), ..Scene::default() }
}
