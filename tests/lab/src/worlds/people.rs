//! Room in which three to ten people walk to and fro among a few drums.

use common::mission::Person;
use glam::DVec2;

use super::shapes::{Room, heading};
use simulation::Random;

use crate::missions::trial::Scene;

const PEOPLE: [usize; 2] = [3, 10];
const SPEEDS_M_S: [f64; 2] = [0.5, 1.5];
/// Nominal.
const RADIUS_M: f64 = 0.25;
const GOALS: usize = 6;
const DENSITY: f64 = 0.04;
/// Free distance of drums around start and target, and of people and their goals from static
/// objects.
const KEPT_FREE_M: f64 = 0.6;
const BEGINS_M: f64 = 1.5;

pub fn draw(random: &mut Random, number: usize) -> Scene {
    let room = Room::draw(random, 8.0, [2.0, 3.0]);
    let target = room.target;
    let shapes = room.with_drums(random, DENSITY, KEPT_FREE_M);
    let [least, most] = PEOPLE;
    let mut people: Vec<Person> = Vec::new();
    for _ in 0..least + number % (most + 1 - least) {
        let free = |random: &mut Random| loop {
            let at = room.place(random);
            if shapes.clearance(at) > KEPT_FREE_M {
                return at;
            }
        };
        let begins = |at: DVec2| {
            at.length() > BEGINS_M && people.iter().all(|it| it.at.distance(at) > KEPT_FREE_M)
        };
        let Some(at) = (0..1000).map(|_| free(random)).find(|at| begins(*at)) else {
            break;
        };
        people.push(Person {
            at,
            goals: (0..GOALS).map(|_| free(random)).collect(),
            speed_m_s: random.in_range(SPEEDS_M_S),
            radius_m: RADIUS_M,
        });
    }
    Scene { shapes, people, heading: heading(random, 3, 0.0), target, ..Scene::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_to_ten_people_begin_apart_and_away_from_the_robot_and_what_stands() {
        let mut numbers = [false; 11];
        for number in 0..24 {
            let scene = draw(&mut Random::of_world(5, 12, number), number as usize);
            let people = &scene.people;
            numbers[people.len()] = true;
            for (index, person) in people.iter().enumerate() {
                assert!(person.at.length() > BEGINS_M);
                assert!(people[..index].iter().all(|it| it.at.distance(person.at) > 0.5));
                let places = person.goals.iter().chain([&person.at]);
                assert!(
                    places.fold(9.0, |least: f64, at| least.min(scene.shapes.clearance(*at))) > 0.5
                );
            }
        }
        assert!(numbers[3] && numbers[10], "{numbers:?}");
    }
}
