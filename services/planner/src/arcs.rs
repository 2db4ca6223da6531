//! The direction that the evidential method gives a car: the car can drive the arc in this direction, and no other arc gets
//! farther along the field.
//!
//! The field turns sharper than a car does. So arcs of several curvatures are followed over the belief, as far as the car
//! looks ahead. An arc that a hazard cuts off before the car could stop is excluded. Among the others, the arc with the
//! greatest progress is given; progress is the line integral of the field's direction along the arc. If all arcs are
//! excluded, the car stands: it can steer no way on.

use std::f64::consts::FRAC_PI_2;

use common::{kinematics::Pose2, mission::Mission};
use glam::DVec2;
use harmonic::Guidance;

use crate::view::View;

/// Number of arcs to either side of straight ahead.
const ARCS_A_SIDE: i32 = 8;
/// Distance between the points of an arc that are looked at, metres.
const STEP_M: f64 = 0.05;
/// How far an arc is followed, metres.
const AHEAD_M: f64 = 0.8;
/// The time in which the car must be able to stop, seconds: the sonar's period, the radio's, the wheels' lag.
const STOPS_WITHIN_S: f64 = 0.6;
/// An arc that is cut off before this is not driven, metres.
const LEAST_FREE_M: f64 = 0.1;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Arcs {
    /// Curvature of the tightest circle, 1/m.
    most_curvature: f64,
    speed: f64,
    turn: f64,
    slow_radius: f64,
}

#[derive(Clone, Copy, Debug)]
struct Followed {
    curvature: f64,
    /// The length that no hazard cuts off, metres.
    free_m: f64,
    /// The progress along the field, metres.
    progress_m: f64,
}

impl Arcs {
    /// The arcs of a mission's robot; none if it can turn on the spot.
    pub(crate) fn new(mission: &Mission) -> Option<Self> {
        let car = mission.body().ackermann()?;
        Some(Self {
            most_curvature: 1.0 / car.least_turning_radius(),
            speed: mission.speed_m_s(),
            turn: mission.turn_rad_s(),
            slow_radius: mission.controller.slow_radius_m,
        })
    }

    /// The direction, a unit vector, by which the controller drives the best arc from `pose`, `distance` metres from the
    /// target, and the most speed on it, m/s. No speed where there is no way on.
    pub(crate) fn advise(&self, view: &View<'_>, pose: &Pose2, distance: f64) -> (DVec2, f64) {
        let arcs = (-ARCS_A_SIDE..=ARCS_A_SIDE).map(|number| {
            let share = f64::from(number) / f64::from(ARCS_A_SIDE);
            Self::follow(view, pose, share * self.most_curvature, distance)
        });
        let best = arcs
            .filter(|arc| arc.free_m >= LEAST_FREE_M.min(distance))
            .max_by(|a, b| a.progress_m.total_cmp(&b.progress_m));
        best.map_or((pose.axis(), 0.0), |arc| {
            (self.direction(pose, arc.curvature, distance), arc.free_m / STOPS_WITHIN_S)
        })
    }

    fn follow(view: &View<'_>, pose: &Pose2, curvature: f64, distance: f64) -> Followed {
        let mut arc = Followed { curvature, free_m: 0.0, progress_m: 0.0 };
        // A car that a new hazard was put around drives out of it.
        let mut inside = view.is_hazard(pose.position);
        let steps = (AHEAD_M.min(distance) / STEP_M).ceil().max(1.0) as usize;
        for step in 1..=steps {
            let way = step as f64 * STEP_M;
            let at = pose.along_arc(way, way * curvature);
            let hazard = view.is_hazard(at.position);
            if hazard && !inside {
                break;
            }
            inside = hazard;
            arc.free_m = way;
            arc.progress_m += STEP_M * view.along(at.position).dot(at.axis());
        }
        arc
    }

    /// The direction by which (15) and (16) give `curvature`.
    fn direction(&self, pose: &Pose2, curvature: f64, distance: f64) -> DVec2 {
        // With s the sine to the direction, the turn rate is wd s, the speed vd (1 - s/2), less near the target.
        let speed = self.speed * (distance / self.slow_radius).min(1.0);
        let sine = curvature * speed / (self.turn + curvature.abs() * speed / 2.0);
        let angle = if sine.abs() < 1.0 { sine.asin() } else { FRAC_PI_2.copysign(sine) };
        DVec2::from_angle(angle).rotate(pose.axis())
    }
}

impl View<'_> {
    /// The field's direction at `at`, a unit vector; zero where it gives none.
    fn along(&self, at: DVec2) -> DVec2 {
        match self.guidance(at) {
            Guidance::Along(direction) | Guidance::WayOut(direction) => direction.into(),
            _ => DVec2::ZERO,
        }
    }
}

#[cfg(test)]
mod tests;
