//! Active sensing of the evidential method: the robot scans ground before it drives there.
//!
//! The sonar cone is narrower than the body, and slanted surfaces reflect its sound away. The sonar
//! must first have pointed at the ground ahead, and square to every surface that the body could
//! touch there. The speed limit lets the robot stop before the next believed hazard or unscanned
//! ground.
//!
//! Advice follows from belief and pose, so a restarted planner continues a scan. Only the side of a
//! scan is stored; chosen per tick, it could alternate.

use common::{
    kinematics::{FACES_COSINE, LEAST_SPEED_M_S, Pose2},
    mission::{Mission, SensorKind},
    motion_law::MotionLaw,
    samples::{GridHeader, GuidanceStatus},
};
use glam::DVec2;

use crate::{
    motion::Advice,
    near_echoes::{STANDS_BEFORE_M, clear_ahead_m},
    outline::Outline,
    undetected_surfaces::UndetectedSurfaces,
    view::{STEP_M, View},
};

const SCANNED_AHEAD_M: f64 = 0.25;
/// Length of the followed field line, and least length of the arc, metres.
const AHEAD_M: f64 = 0.6;
/// Distance to the point that the robot heads for, in body radii.
const AIM_RADII: f64 = 2.4;

#[derive(Debug)]
pub(crate) struct ActiveSensing {
    radius: f64,
    ground_m: f64,
    pub outline: Option<Outline>,
    law: MotionLaw,
    brakes_within_s: f64,
    bearing: DVec2,
    /// Length of the arc, metres: at least the stopping distance at top speed.
    ahead_m: f64,
    sonars: usize,
    /// It detects surfaces of any angle, so scanned ground is free.
    has_laser: bool,
    /// Whether the robot heads for a point of the way ahead.
    ///
    /// Bodies other than discs fit only on the way itself; with a front sonar alone, aiming doubled
    /// the touches.
    aims: bool,
    /// Side of the current scan: left is 0, right is 1.
    scan_side: Option<usize>,
}

impl ActiveSensing {
    pub(crate) fn new(mission: &Mission) -> Self {
        let law = MotionLaw::new(mission);
        let brakes_within_s = mission.brakes_within_s();
        let stops_m = law.response.way_to_stop_m(law.speed, brakes_within_s);
        assert!(stops_m >= 0.0 && stops_m.is_finite());
        let (radius, outline) = (mission.body().radius_m, mission.outline());
        Self {
            radius,
            ground_m: outline.map_or(radius, |it| it.half_widths_m()[1]),
            outline: outline.map(|it| Outline::new(mission, &it)),
            law,
            brakes_within_s,
            bearing: DVec2::from_angle(mission.front_sonar().faces_rad()),
            ahead_m: AHEAD_M.max(stops_m + STEP_M),
            sonars: mission.used(SensorKind::Cone),
            has_laser: mission.used(SensorKind::Scan) > 0,
            aims: outline.is_none()
                && mission.used(SensorKind::Scan) + mission.used(SensorKind::Ray) > 0,
            scan_side: None,
        }
    }

    pub(crate) fn advise(
        &mut self,
        view: &View<'_>,
        belief: &GridHeader,
        pose: &Pose2,
        direction: DVec2,
    ) -> Advice {
        let (place, ahead_m) = (pose.position, self.ahead_m);
        let undetected = UndetectedSurfaces::new(belief, self.radius, place, ahead_m);
        let way = view.way(pose.position, direction, AHEAD_M);
        let steps = (SCANNED_AHEAD_M / STEP_M) as usize;
        let ahead = &way[..steps.min(way.len())];
        let ground = ahead
            .iter()
            .flat_map(|&at| view.unscanned(at, self.ground_m))
            .filter_map(|at| (at - pose.position).try_normalize());
        let before = std::iter::once(&pose.position).chain(ahead);
        let surfaces = before.zip(ahead).flat_map(|(&from, &to)| {
            let along = (to - from).normalize_or(direction);
            undetected.normals(to, along)
        });
        let surfaces = surfaces.filter(|_| !self.has_laser);
        let unseen = ground.chain(surfaces);
        let axis = self.bearing.rotate(pose.axis());
        if let Some(there) = scan(axis, unseen, &mut self.scan_side) {
            let there = DVec2::new(self.bearing.x, -self.bearing.y).rotate(there);
            return Advice::new(GuidanceStatus::Look, there, 0.0);
        }
        let direction = self.aim(view, &undetected, place, &way).unwrap_or(direction);
        let limit = self.limit(view, &undetected, belief, pose, direction);
        Advice::along(direction, limit)
    }

    /// Returns the speed limit by the newest readings along the robot's axis, m/s: 0 for an echo
    /// right before the body.
    pub(crate) fn limit_before_echoes(&self, belief: &GridHeader, pose: &Pose2) -> f64 {
        let clear_m = clear_ahead_m(belief, pose, self.radius, self.sonars);
        if clear_m < STANDS_BEFORE_M {
            return 0.0;
        }
        self.law.response.speed_to_stop_within(clear_m, self.brakes_within_s)
    }

    fn is_open(
        &self,
        view: &View<'_>,
        undetected: &UndetectedSurfaces,
        at: DVec2,
        axis: DVec2,
    ) -> bool {
        !view.is_hazard(at)
            && view.unscanned(at, self.ground_m).next().is_none()
            && (self.has_laser || undetected.normals(at, axis).next().is_none())
    }

    /// Returns the direction to the farthest point of the `way` that a straight open line reaches.
    ///
    /// The field bends only right before a hazard, too late for a robot that follows its local
    /// direction.
    fn aim(
        &self,
        view: &View<'_>,
        undetected: &UndetectedSurfaces,
        place: DVec2,
        way: &[DVec2],
    ) -> Option<DVec2> {
        let within = (AIM_RADII * self.radius / STEP_M) as usize;
        let is_open = |to: &DVec2| {
            let (steps, axis) = ((to.length() / STEP_M).ceil(), to.normalize_or_zero());
            (1..=steps as u32).all(|step| {
                self.is_open(view, undetected, place + *to * (f64::from(step) / steps), axis)
            })
        };
        let points = way.iter().take(within).rev().map(|at| *at - place);
        points.filter(|_| self.aims).find(is_open)?.try_normalize()
    }

    /// Returns the speed limit by readings and by the controller's arc into `direction`, m/s.
    ///
    /// A robot that faces a permitted way keeps the least speed if the readings allow it, so a
    /// blocked arc cannot stop it forever.
    fn limit(
        &self,
        view: &View<'_>,
        undetected: &UndetectedSurfaces,
        belief: &GridHeader,
        pose: &Pose2,
        direction: DVec2,
    ) -> f64 {
        let curvature = self.law.turn * pose.axis().perp_dot(direction) / self.law.speed;
        let steps = (self.ahead_m / STEP_M) as usize;
        let open = |step: &usize| {
            let way = *step as f64 * STEP_M;
            let ahead = pose.along_arc(way, way * curvature);
            self.is_open(view, undetected, ahead.position, ahead.axis())
                && !self.outline.as_ref().is_some_and(|it| it.touches(view, &ahead))
        };
        let free = (1..=steps).find(|step| !open(step)).unwrap_or(steps + 1) - 1;
        let room_m = free as f64 * STEP_M;
        let on_arc = self.law.response.speed_to_stop_within(room_m, self.brakes_within_s);
        let faces = pose.axis().dot(direction) > FACES_COSINE;
        let least = if faces { LEAST_SPEED_M_S } else { 0.0 };
        on_arc.max(least).min(self.limit_before_echoes(belief, pose))
    }
}

/// Returns the far end of one side of the `unseen` directions from `axis`.
///
/// A scan keeps its `side` until that side is seen. A new scan begins on the side with the nearest
/// direction.
fn scan(
    axis: DVec2,
    unseen: impl Iterator<Item = DVec2>,
    side: &mut Option<usize>,
) -> Option<DVec2> {
    // Left and right: least angle, greatest angle and its direction.
    let mut sides = [(f64::INFINITY, -1.0, axis); 2];
    for there in unseen {
        let angle = axis.angle_to(there);
        let (least, greatest, end) = &mut sides[usize::from(angle < 0.0)];
        *least = least.min(angle.abs());
        if angle.abs() > *greatest {
            (*greatest, *end) = (angle.abs(), there);
        }
    }
    let is_unseen = |side: &usize| sides[*side].0.is_finite();
    let nearer = usize::from(sides[1].0 < sides[0].0);
    *side = side.filter(is_unseen).or(Some(nearer)).filter(is_unseen);
    side.map(|side| sides[side].2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scan_turns_to_the_far_end_of_the_nearer_side_until_nothing_is_unseen_there() {
        let at = |degrees: f64| DVec2::from_angle(degrees.to_radians());
        let mut side = None;
        let mut turn = |unseen: &[f64]| scan(DVec2::X, unseen.iter().copied().map(at), &mut side);
        assert_eq!(turn(&[20.0, 50.0, 35.0, -30.0, -80.0]), Some(at(50.0)));
        assert_eq!(turn(&[-10.0, 60.0]), Some(at(60.0)), "the other side is nearer now");
        assert_eq!(turn(&[-10.0, -20.0]), Some(at(-20.0)), "nothing is left on this side");
        assert_eq!(turn(&[-20.0, 10.0]), Some(at(-20.0)));
        assert_eq!(turn(&[]), None);
        assert_eq!(turn(&[-20.0, 10.0]), Some(at(10.0)), "a new scan begins on the nearer side");
    }
}
