//! Hall with moving cylinders, after DynaBARN (A. Nair et al., "DynaBARN: Benchmarking Metric
//! Ground Navigation in Dynamic Environments", SSRR 2022).
//!
//! Hall, start, goal, rules, and the cylinders' radius and numbers follow its public generator
//! (`github.com/aninair1905/DynaBARN`) and the BARN challenge, which ships its 60 worlds. A path is
//! a polynomial through points on whole metres, with ten further stations. Each leg's speed is
//! drawn from a normal distribution truncated at the minimum and maximum speed. Speeds are those of
//! the shipped trajectories, orders are inferred from their stations, and the speeds' standard
//! deviations are nominal.
//!
//! A cylinder returns at the end of its path, where DynaBARN's jumps to the beginning. It moves
//! straight between stations, where DynaBARN's follows a spline. A path that leaves the hall ends
//! at the last station inside instead of at the wall.

use std::f64::consts::PI;

use common::mission::{Move, Thing};
use glam::{DVec2, Vec2Swizzles as _};

use super::{
    barn,
    shapes::{block, boxes, drum, drums},
};
use simulation::Random;

use crate::missions::trial::{Rules, Scene};

const START: DVec2 = DVec2::new(11.0, 0.0);
const GOAL: DVec2 = DVec2::new(-9.0, 0.0);
const HALF_M: f64 = 10.0;
const WALL_M: f64 = 0.5;
const RADIUS_M: f64 = 0.5;
/// Beside the polynomial's points, evenly spaced along x.
const STATIONS: usize = 10;
/// Longer than a mission by the challenge's rules.
const MOVES_S: f64 = 130.0;

/// Difficulty of a world: inclusive ranges of cylinders, orders, speeds (m/s) and their deviations.
type Difficulty = ([usize; 2], [usize; 2], [f64; 2], [f64; 2]);

const DIFFICULTIES: [Difficulty; 3] = [
    ([5, 14], [1, 2], [0.5, 0.9], [0.01, 0.1]),
    ([15, 19], [2, 4], [1.0, 1.4], [0.05, 0.15]),
    ([20, 24], [3, 5], [1.5, 1.9], [0.1, 0.2]),
];

/// These worlds have no reference path for a score.
pub const RULES: Rules = Rules { scored: false, ..barn::RULES };

/// Draws hall `number`, which selects the difficulty.
pub fn draw(random: &mut Random, number: usize) -> Scene {
    let difficulty = &DIFFICULTIES[number % DIFFICULTIES.len()];
    let along = DVec2::new(2.0 * HALF_M, WALL_M);
    let walls = [
        block(DVec2::new(-HALF_M, 0.0), along.yx(), 0.0),
        block(DVec2::new(0.0, HALF_M), along, 0.0),
        block(DVec2::new(0.0, -HALF_M), along, 0.0),
    ];
    let cylinders = one_of(random, difficulty.0);
    Scene {
        shapes: boxes(walls),
        things: (0..cylinders).map(|_| cylinder(random, difficulty)).collect(),
        start: START,
        heading: PI,
        target: GOAL,
        ..Scene::default()
    }
}

fn one_of(random: &mut Random, [least, most]: [usize; 2]) -> usize {
    least + random.below(most - least + 1)
}

fn cylinder(random: &mut Random, &(_, orders, speeds, deviations): &Difficulty) -> Thing {
    let path = path(random, orders);
    let mean = random.in_range(speeds);
    let deviation = random.in_range(deviations);
    let (mut at_s, mut at) = (0.0, path[0]);
    let mut moves = vec![Move { at_s, by: DVec2::ZERO }];
    for &next in path.iter().skip(1).chain(path.iter().rev().skip(1)).cycle() {
        if at_s > MOVES_S {
            break;
        }
        let speed = loop {
            let speed = random.in_range(speeds);
            if random.chance((-0.5 * ((speed - mean) / deviation).powi(2)).exp()) {
                break speed;
            }
        };
        at_s += at.distance(next) / speed;
        at = next;
        moves.push(Move { at_s, by: at - path[0] });
    }
    let shape = drums([drum(path[0], RADIUS_M)]);
    Thing { shape, from_s: 0.0, until_s: None, moves }
}

/// Includes the polynomial's points, in either direction.
fn path(random: &mut Random, orders: [usize; 2]) -> Vec<DVec2> {
    let order = one_of(random, orders);
    let mut points: Vec<DVec2> = Vec::new();
    while points.len() <= order {
        let point = random.point(DVec2::ZERO, DVec2::splat(HALF_M + 0.5)).round();
        if point.abs().max_element() <= HALF_M && points.iter().all(|other| other.x != point.x) {
            points.push(point);
        }
    }
    let step_m = 2.0 * HALF_M / (STATIONS - 1) as f64;
    let further = (0..STATIONS).map(|station| {
        let x = step_m * station as f64 - HALF_M;
        DVec2::new(x, polynomial(&points, x))
    });
    let inside = further.filter(|station| station.y.abs() <= HALF_M);
    let mut path: Vec<DVec2> = inside.chain(points.iter().copied()).collect();
    path.sort_by(|a, b| a.x.total_cmp(&b.x));
    path.dedup();
    if random.chance(0.5) {
        path.reverse();
    }
    path
}

/// Evaluates the polynomial by Lagrange's formula.
fn polynomial(points: &[DVec2], x: f64) -> f64 {
    let share = |own: &DVec2| -> f64 {
        let others = points.iter().filter(|other| other.x != own.x);
        others.map(|other| (x - other.x) / (own.x - other.x)).product()
    };
    points.iter().map(|own| own.y * share(own)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cylinders_start_clear_of_the_robot_and_move_in_the_hall_at_the_speeds_of_their_difficulty_all_the_time()
     {
        for number in 0..30 {
            let scene = draw(&mut Random::of_world(1, 11, number), number as usize);
            let (cylinders, _, [least, most], _) = DIFFICULTIES[number as usize % 3];
            assert!((cylinders[0]..=cylinders[1]).contains(&scene.things.len()));
            for Thing { shape, moves, .. } in &scene.things {
                let start = shape.drums[0].at;
                assert!(shape.clearance(START) >= 0.5 - 1e-9, "{start}");
                assert!(moves.last().unwrap().at_s > MOVES_S);
                for leg in moves.windows(2) {
                    let speed = leg[0].by.distance(leg[1].by) / (leg[1].at_s - leg[0].at_s);
                    assert!((least - 1e-6..=most + 1e-6).contains(&speed), "{speed}");
                    assert!((start + leg[1].by).abs().max_element() <= HALF_M + 1e-9);
                }
            }
        }
    }

    #[test]
    fn a_polynomial_goes_through_its_points() {
        let points = [DVec2::new(-2.0, 4.0), DVec2::new(0.0, 0.0), DVec2::new(3.0, 9.0)];
        assert!(points.iter().all(|point| polynomial(&points, point.x) == point.y));
        assert!((polynomial(&points, 1.0) - 1.0).abs() < 1e-12);
    }
}
