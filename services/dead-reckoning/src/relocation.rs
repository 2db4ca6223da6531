//! Relocation by fixes that contradict the pose but agree, for example after the robot was carried.

use std::{collections::VecDeque, time::Duration};

use common::kinematics::Pose2;
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::filter::{Filter, Fix, GATES, wrapped};

const AGREE: usize = 10;
/// Relocations after which contradicting fixes show a source that contradicts itself.
pub(crate) const MOST_RELOCATIONS: u64 = 2;
/// Least time between fixes: ten take 3 s.
const APART: Duration = Duration::from_millis(334);
/// Variance of wheel travel between two fixes, m^2.
const WHEELS: f64 = 4e-4;
/// Largest deviation of a heading from motion among fixes, radians.
const KNOWN_RAD: f64 = 0.2;
/// Heading variance otherwise, rad^2.
const UNKNOWN: f64 = 1.0;
/// Least turn, in deviations. Below, the wheels' heading is better than one from a short distance.
const NO_TURN: f64 = 3.0;

/// Refused fixes since a used one of their kind, with the poses at their times.
///
/// A scan that matches the robot's own map does not refute a camera: both may be elsewhere.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Contradictions(VecDeque<(Pose2, Fix)>);

impl Contradictions {
    pub(crate) fn settle(&mut self, used: &Fix) {
        self.0.retain(|(_, refused)| refused.is_by_scan() != used.is_by_scan());
    }

    /// Returns the relocated estimate if the newest fixes agree.
    pub(crate) fn add(&mut self, there: Pose2, fix: &Fix, estimate: &Filter) -> Option<Filter> {
        if self.0.back().is_some_and(|(_, last)| fix.time.since(last.time) < APART) {
            return None;
        }
        self.0.push_back((there, *fix));
        if self.0.len() > AGREE {
            self.0.pop_front();
        }
        let elsewhere = (self.0.len() == AGREE).then(|| self.agreed(estimate)).flatten()?;
        self.0.clear();
        Some(elsewhere)
    }

    /// Moves `estimate` by the rigid motion that best fits poses to fixes (least squares). None if
    /// a fix then exceeds its gate.
    fn agreed(&self, estimate: &Filter) -> Option<Filter> {
        let share = 1.0 / self.0.len() as f64;
        let mean = |of: fn(&Pose2, &Fix) -> DVec2| {
            self.0.iter().map(|(pose, fix)| of(pose, fix)).sum::<DVec2>() * share
        };
        let from = mean(|pose, _| pose.position);
        let to = mean(|_, fix| fix.position);
        let variance = self.0.iter().map(|(_, fix)| fix.variance()).sum::<f64>() * share + WHEELS;
        let (turn, heading) = self.turned(from, to, variance);
        let turned = DVec2::from_angle(turn);
        let agrees = |(pose, fix): &(Pose2, Fix)| {
            let way = to + turned.rotate(pose.position - from) - fix.position;
            way.length_squared() <= GATES[0] * (fix.variance() + WHEELS)
        };
        if !self.0.iter().all(agrees) {
            return None;
        }
        let lever = estimate.pose.position - from;
        let pose =
            Pose2 { position: to + turned.rotate(lever), heading: estimate.pose.heading + turn };
        Some(estimate.moved_to(pose, variance + heading * lever.length_squared(), heading))
    }

    fn turned(&self, from: DVec2, to: DVec2, variance: f64) -> (f64, f64) {
        let turns = self.0.iter().filter_map(|(pose, fix)| {
            Some((wrapped(fix.heading? - pose.heading), fix.covariance[5]))
        });
        if turns.clone().count() == self.0.len() {
            let sum: DVec2 = turns.clone().map(|(turn, _)| DVec2::from_angle(turn)).sum();
            let share = 1.0 / self.0.len() as f64;
            return (sum.to_angle(), turns.map(|(_, variance)| variance).sum::<f64>() * share);
        }
        let arms = self.0.iter().map(|(pose, fix)| (pose.position - from, fix.position - to));
        let spread: f64 = arms.clone().map(|(arm, _)| arm.length_squared()).sum();
        if spread * KNOWN_RAD * KNOWN_RAD <= variance {
            return (0.0, UNKNOWN);
        }
        let sum = |of: fn((DVec2, DVec2)) -> f64| arms.clone().map(of).sum::<f64>();
        let cosine = sum(|(a, b)| a.dot(b));
        let sine = sum(|(a, b)| a.perp_dot(b));
        let turn = sine.atan2(cosine);
        let is_turn = turn * turn > NO_TURN * NO_TURN * variance / spread;
        (if is_turn { turn } else { 0.0 }, variance / spread)
    }
}
