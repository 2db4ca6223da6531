//! Active sensing: the evidential method checks a direction before the robot goes there.
//!
//! The one sonar looks ahead, the body is wider than its cone where it matters, and a surface at a slant does not answer. So
//! before the robot drives over ground, the sonar must have been pointed there, and square to every surface that could be
//! touched there. The robot drives no faster than it could stop before the next thing it believes in, or the next ground
//! it has not scanned.
//!
//! It is computed from the belief and the pose: a scan only turns the sonar, tick by tick, to ground that is not scanned yet, so a
//! planner that is restarted goes on with it. The only memory is the side to which a scan turns: wheels lag, so a side that is chosen
//! anew with each tick may change with each tick.

use std::f64::consts::{PI, TAU};

use common::{
    kinematics::{FACES_COSINE, LEAST_SPEED_M_S, Pose2},
    mission::{Mission, SensorKind},
    samples::GridHeader,
};
use glam::DVec2;

use crate::{
    near_echoes::{STANDS_BEFORE_M, clear_ahead_m},
    undetected_surfaces::UndetectedSurfaces,
    view::{STEP_M, View},
};

/// The ground under so much of the way ahead must have been scanned, and no surface could be touched there undetected, metres.
const SCANNED_AHEAD_M: f64 = 0.25;
/// How far ahead the way is followed, metres.
const AHEAD_M: f64 = 0.6;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Advice {
    /// Go, no faster than this, m/s.
    Go(f64),
    /// Turn on the spot until this unit vector is faced.
    Look(DVec2),
}

/// A side of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Left,
    Right,
}

#[derive(Clone, Debug)]
pub(crate) struct ActiveSensing {
    radius: f64,
    speed: f64,
    turn: f64,
    /// The time in which the robot must be able to stop, seconds.
    stops_within_s: f64,
    /// Bearings of the sonars that the mission uses, radians from the robot's axis.
    sonars: Vec<f64>,
    /// The side to which the present scan turns; none while there is no scan.
    scan_side: Option<Side>,
}

impl ActiveSensing {
    pub(crate) fn new(mission: &Mission) -> Self {
        Self {
            radius: mission.body().radius_m,
            speed: mission.speed_m_s(),
            turn: mission.turn_rad_s(),
            stops_within_s: mission.planner.stops_within_s,
            sonars: sonars(mission),
            scan_side: None,
        }
    }

    /// Advice for a robot at `pose` that is to go along `direction`, a unit vector, by the readings in `belief`.
    pub(crate) fn advise(
        &mut self,
        view: &View<'_>,
        belief: &GridHeader,
        pose: &Pose2,
        direction: DVec2,
    ) -> Advice {
        let undetected = UndetectedSurfaces::new(belief, self.radius);
        let way = view.way(pose.position, direction, AHEAD_M);
        let steps = (SCANNED_AHEAD_M / STEP_M) as usize;
        let ahead = &way[..steps.min(way.len())];
        let ground = ahead
            .iter()
            .flat_map(|&at| view.unscanned(at, self.radius))
            .filter_map(|at| (at - pose.position).try_normalize());
        let before = std::iter::once(&pose.position).chain(ahead);
        let surfaces = before.zip(ahead).flat_map(|(&from, &to)| {
            let along = (to - from).normalize_or(direction);
            undetected.normals(to, along)
        });
        let unseen = ground.chain(surfaces);
        match scan(pose.axis(), &self.sonars, unseen, &mut self.scan_side) {
            Some(there) => Advice::Look(there),
            None => Advice::Go(self.limit(view, &undetected, belief, pose, direction)),
        }
    }

    /// The most speed that the newest readings allow along the robot's axis, m/s: none towards an echo right before the body.
    pub(crate) fn limit_before_echoes(&self, belief: &GridHeader, pose: &Pose2) -> f64 {
        let clear_m = clear_ahead_m(belief, pose, self.radius, self.sonars.len());
        if clear_m < STANDS_BEFORE_M {
            return 0.0;
        }
        clear_m / self.stops_within_s
    }

    /// The speed allowed by the readings and by the arc on which the controller brings the robot into `direction`, m/s.
    ///
    /// A robot that faces a way which the belief does not forbid would stand for ever where the arc allows no speed. It
    /// goes as slowly as it can instead, as long as the readings allow that.
    fn limit(
        &self,
        view: &View<'_>,
        undetected: &UndetectedSurfaces,
        belief: &GridHeader,
        pose: &Pose2,
        direction: DVec2,
    ) -> f64 {
        let curvature = self.turn * pose.axis().perp_dot(direction) / self.speed;
        let steps = (AHEAD_M / STEP_M) as usize;
        let open = |step: &usize| {
            let way = *step as f64 * STEP_M;
            let ahead = pose.along_arc(way, way * curvature);
            let at = ahead.position;
            !view.is_hazard(at)
                && view.unscanned(at, self.radius).next().is_none()
                && undetected.normals(at, ahead.axis()).next().is_none()
        };
        let free = (1..=steps).find(|step| !open(step)).unwrap_or(steps + 1) - 1;
        let on_arc = free as f64 * STEP_M / self.stops_within_s;
        let faces = pose.axis().dot(direction) > FACES_COSINE;
        let least = if faces { LEAST_SPEED_M_S } else { 0.0 };
        on_arc.max(least).min(self.limit_before_echoes(belief, pose))
    }
}

/// The bearings of the sonars that `mission` uses, radians from the robot's axis.
fn sonars(mission: &Mission) -> Vec<f64> {
    let table = mission.sensor_table().into_iter();
    let used = table.filter(|sensor| sensor.used && sensor.kind == SensorKind::Cone);
    used.map(|sensor| sensor.mount.bearing_rad).collect()
}

/// Where a robot that faces `axis` has to face for its `sonars` to scan all directions in `unseen`: it turns to the far end of a side
/// without a stop, and each direction is left to the sonar that needs the least turn. A scan that began on a `side` turns there until
/// nothing is unseen on it; a new one begins on the side where the first direction needs the lesser turn.
fn scan(
    axis: DVec2,
    sonars: &[f64],
    unseen: impl Iterator<Item = DVec2>,
    side: &mut Option<Side>,
) -> Option<DVec2> {
    // For the left and the right: the least and the greatest turn, radians.
    let mut sides = [None::<(f64, f64)>; 2];
    for there in unseen {
        let angle = axis.angle_to(there);
        let turns = sonars.iter().map(|bearing| wrapped(angle - bearing));
        let Some(turn) = turns.min_by(|a, b| a.abs().total_cmp(&b.abs())) else {
            continue;
        };
        let side = &mut sides[usize::from(turn < 0.0)];
        let turn = turn.abs();
        let (least, greatest) = side.unwrap_or((turn, turn));
        *side = Some((least.min(turn), greatest.max(turn)));
    }
    let [left, right] = sides;
    *side = match (left, right, *side) {
        (None, None, _) => None,
        (Some(_), None, _) | (Some(_), Some(_), Some(Side::Left)) => Some(Side::Left),
        (None, Some(_), _) | (Some(_), Some(_), Some(Side::Right)) => Some(Side::Right),
        (Some((left, _)), Some((right, _)), None) if left <= right => Some(Side::Left),
        (Some(_), Some(_), None) => Some(Side::Right),
    };
    let turn = match (*side)? {
        Side::Left => left?.1,
        Side::Right => -right?.1,
    };
    Some(DVec2::from_angle(turn).rotate(axis))
}

/// `angle` within half a turn of 0, radians.
fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where a robot that faces x turns to scan these directions, degrees.
    fn turn(sonars_deg: &[f64], unseen_deg: &[f64], side: &mut Option<Side>) -> Option<i32> {
        let sonars: Vec<_> = sonars_deg.iter().map(|degrees| degrees.to_radians()).collect();
        let unseen = unseen_deg.iter().map(|degrees| DVec2::from_angle(degrees.to_radians()));
        let there = scan(DVec2::X, &sonars, unseen, side)?;
        Some(there.to_angle().to_degrees().round() as i32)
    }

    #[test]
    fn a_scan_turns_to_the_nearer_side_and_there_to_its_far_end() {
        assert_eq!(turn(&[0.0], &[20.0, 50.0, 35.0, -30.0, -80.0], &mut None), Some(50));
        assert_eq!(turn(&[10.0], &[20.0, 50.0, 35.0, -30.0, -80.0], &mut None), Some(40));
        assert_eq!(turn(&[0.0], &[], &mut Some(Side::Left)), None);
    }

    #[test]
    fn each_direction_is_left_to_the_sonar_that_needs_the_least_turn() {
        let three = [0.0, 45.0, -45.0];
        assert_eq!(turn(&three, &[60.0, 55.0, 40.0], &mut Some(Side::Left)), Some(15));
        assert_eq!(turn(&three, &[30.0, -20.0], &mut None), Some(-15));
        assert_eq!(turn(&three, &[179.0], &mut None), Some(134));
    }

    #[test]
    fn a_scan_keeps_its_side_until_nothing_is_unseen_there() {
        let mut side = None;
        let mut turn = |unseen: &[f64]| turn(&[0.0], unseen, &mut side);
        assert_eq!(turn(&[-40.0, 30.0]), Some(30));
        assert_eq!(turn(&[-10.0, 60.0]), Some(60), "the other side is nearer now");
        assert_eq!(turn(&[-10.0, -20.0]), Some(-20), "nothing is left on this side");
        assert_eq!(turn(&[-20.0, 10.0]), Some(-20));
        assert_eq!(turn(&[]), None);
        assert_eq!(turn(&[-20.0, 10.0]), Some(10), "a new scan begins on the nearer side");
    }
}
