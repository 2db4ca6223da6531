//! People who walk by the social-force model.
//!
//! Model and constants: D. Helbing and P. Molnar, "Social force model for pedestrian dynamics",
//! Physical Review E 51, 1995. Distances are between bodies, as in D. Helbing, I. Farkas and T.
//! Vicsek, Nature 407, 2000.
//!
//! A person walks to the next goal at its own speed. People, the robot and static objects repel it;
//! those behind count half. Forces alone allow overlaps, so velocity into a near body is removed. A
//! late goal is given up, because the model plans no path around obstacles.

use common::{
    geometry::{Drum, Profile},
    mission::Person,
};
use glam::DVec2;

use crate::world::{Solid, Surface};

/// Time constant for reaching the wanted velocity.
const RELAXES_S: f64 = 0.5;
/// Potential of other people, m^2/s^2, and its decay length, metres.
const OF_OTHERS: (f64, f64) = (2.1, 0.3);
/// Potential of walls and other static objects, and its decay length.
const OF_WALLS: (f64, f64) = (10.0, 0.2);
/// Length of another's step to keep clear of.
const STEP_S: f64 = 2.0;
/// Half the field of view, and the weight of those outside it.
const SEES_RAD: f64 = 100.0 / 180.0 * std::f64::consts::PI;
const UNSEEN: f64 = 0.5;
const HURRIES: f64 = 1.3;
/// Minimum distance to another body; nominal.
const KEPT_M: f64 = 0.1;
/// Distance beyond which static objects have no force.
const NEAR_M: f64 = 2.0;
/// Distance at which a goal is reached; multiple of the direct time, plus seconds, after which it
/// is given up.
const REACHED_M: f64 = 0.3;
const PATIENCE: (f64, f64) = (2.0, 3.0);
/// Maximum step, and maximum time simulated at once.
const LONGEST_S: f64 = 0.05;
const MOST_S: f64 = 60.0;

#[derive(Debug)]
pub struct People {
    walkers: Vec<Walker>,
    /// Seconds.
    now: Option<(f64, DVec2)>,
}

#[derive(Debug)]
struct Walker {
    person: Person,
    at: DVec2,
    velocity: DVec2,
    goal: usize,
    left_s: f64,
}

/// Place, velocity and radius of a body.
type Other = (DVec2, DVec2, f64);

impl People {
    pub fn new(people: &[Person]) -> Self {
        let walker = |person: &Person| Walker {
            at: person.at,
            velocity: DVec2::ZERO,
            goal: 0,
            left_s: patience_s(person, person.at, 0),
            person: person.clone(),
        };
        Self { walkers: people.iter().map(walker).collect(), now: None }
    }

    pub fn advance(&mut self, time: f64, (robot, radius): (DVec2, f64), standing: &[Solid]) {
        let (from_s, from) = self.now.replace((time, robot)).unwrap_or((0.0, robot));
        let for_s = (time - from_s).clamp(0.0, MOST_S);
        if self.walkers.is_empty() || for_s == 0.0 {
            return;
        }
        const { assert!(LONGEST_S < RELAXES_S) };
        let steps = (for_s / LONGEST_S).ceil();
        let dt = for_s / steps;
        let robot = (robot, (robot - from) / for_s, radius);
        for _ in 0..steps as usize {
            let other = |it: &Walker| (it.at, it.velocity, it.person.radius_m);
            let others: Vec<_> = self.walkers.iter().map(other).collect();
            for (own, walker) in self.walkers.iter_mut().enumerate() {
                let others = others.iter().enumerate().filter(|(other, _)| *other != own);
                let others = others.map(|(_, other)| *other).chain([robot]);
                walker.step(others, standing, dt);
            }
        }
    }

    pub fn solids(&self) -> impl Iterator<Item = Solid> {
        let profile: Profile = Drum::default().profile();
        self.walkers.iter().map(move |Walker { at, person, .. }| Solid {
            surface: Surface::Drum { at: *at, radius: person.radius_m },
            profile,
        })
    }
}

fn patience_s(person: &Person, at: DVec2, goal: usize) -> f64 {
    assert!(person.speed_m_s > 0.0);
    let far_m = person.goals.get(goal).map_or(0.0, |goal| goal.distance(at));
    PATIENCE.0 * far_m / person.speed_m_s + PATIENCE.1
}

impl Walker {
    fn step(&mut self, others: impl Iterator<Item = Other>, standing: &[Solid], dt: f64) {
        let Some(goal) = self.person.goals.get(self.goal) else {
            return;
        };
        let wants = (*goal - self.at).normalize_or_zero();
        let mut force = (self.person.speed_m_s * wants - self.velocity) / RELAXES_S;
        let mut before: Vec<DVec2> = Vec::new();
        for (at, velocity, radius) in others {
            let both_m = radius + self.person.radius_m;
            let offset = self.at - at;
            let repelled = by_another(offset, STEP_S * velocity, both_m);
            let sees = wants.dot(-repelled) >= repelled.length() * SEES_RAD.cos();
            force += if sees { repelled } else { UNSEEN * repelled };
            before.extend((offset.length() < both_m + KEPT_M).then(|| offset.normalize_or_zero()));
        }
        for Solid { surface, .. } in standing {
            let away_m = surface.distance(self.at);
            if away_m < NEAR_M
                && let Some(outward) = surface.outward(self.at)
            {
                let (potential, over_m) = OF_WALLS;
                force += potential / over_m * (-away_m.max(0.0) / over_m).exp() * outward;
            }
        }
        let most = HURRIES * self.person.speed_m_s;
        self.velocity = (self.velocity + force * dt).clamp_length_max(most);
        for away in before {
            self.velocity -= away * away.dot(self.velocity).min(0.0);
        }
        self.at += self.velocity * dt;
        self.left_s -= dt;
        if self.at.distance(*goal) < REACHED_M || self.left_s < 0.0 {
            self.goal = (self.goal + 1) % self.person.goals.len();
            self.left_s = patience_s(&self.person, self.at, self.goal);
        }
    }
}

/// Returns the repulsion by a person `offset` away, whose bodies touch at `both_m`. Its potential
/// is an ellipse around the other's `step`.
fn by_another(offset: DVec2, step: DVec2, both_m: f64) -> DVec2 {
    let after = offset - step;
    let sum = offset.length() + after.length();
    let minor = 0.5 * (sum * sum - step.length_squared()).max(1e-6).sqrt();
    let (potential, over_m) = OF_OTHERS;
    let outward = 0.5 * (offset.normalize_or_zero() + after.normalize_or_zero());
    potential / over_m * ((both_m - minor) / over_m).min(1.0).exp() * sum / (2.0 * minor) * outward
}

#[cfg(test)]
mod tests {
    use super::*;

    fn person(at: DVec2, goal: DVec2) -> Person {
        Person { at, goals: vec![goal, at], speed_m_s: 1.0, radius_m: 0.25 }
    }

    /// Returns the minimum distance in 8 s between two people, or one and a robot.
    fn least_m(people: &[Person], robot: DVec2) -> f64 {
        let mut people = People::new(people);
        let mut least = f64::INFINITY;
        for tick in 1..=80 {
            people.advance(f64::from(tick) * 0.1, (robot, 0.2), &[]);
            let other = people.walkers.get(1).map_or(robot, |other| other.at);
            least = least.min(people.walkers[0].at.distance(other));
        }
        least
    }

    #[test]
    fn people_walk_to_their_goals_and_back_around_each_other_and_the_robot() {
        let [left, right] = [-3.0, 3.0].map(|x| DVec2::new(x, 0.0));
        let far = DVec2::splat(50.0);
        let beside = DVec2::new(0.0, 0.05);
        let two = [person(left, right), person(right + beside, left + beside)];
        let (both, alone) = (least_m(&two, far), least_m(&two[..1], beside));
        assert!(both > 0.5 && alone > 0.45, "{both} {alone}");
        let mut one = People::new(&two[..1]);
        one.advance(7.5, (far, 0.2), &[]);
        assert!(one.walkers[0].goal == 1 && one.walkers[0].velocity.x < -0.8, "{one:?}");
    }

    #[test]
    fn a_goal_behind_a_wall_is_given_up_and_nobody_walks_through_the_wall() {
        let surface = Surface::Face { from: DVec2::new(1.0, -9.0), to: DVec2::new(1.0, 9.0) };
        let wall = Solid { surface, profile: Drum::default().profile() };
        let mut one = People::new(&[person(DVec2::ZERO, DVec2::new(3.0, 0.0))]);
        for tick in 1..=92 {
            one.advance(f64::from(tick) * 0.1, (DVec2::splat(50.0), 0.2), &[wall]);
            assert!(one.walkers[0].at.x < 0.8);
        }
        assert_eq!(one.walkers[0].goal, 1);
    }
}
