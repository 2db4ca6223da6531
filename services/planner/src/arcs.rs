//! Evidential direction of a car: along the drivable arc with the most progress along the field.
//!
//! The field turns tighter than a car, so arcs of several curvatures are followed over the belief.
//! An arc with less free length than [`LEAST_FREE_M`] is excluded. The best arc has the greatest
//! line integral of the field direction. If all are excluded, the car stands.

use std::f64::consts::FRAC_PI_2;

use common::{kinematics::Pose2, mission::Mission, motion_law::MotionLaw};
use glam::DVec2;
use harmonic::Guidance;

use crate::view::View;

/// Arcs to either side of straight ahead.
const ARCS_A_SIDE: i32 = 8;
const STEP_M: f64 = 0.05;
const AHEAD_M: f64 = 0.8;
/// Time until the car brakes, seconds: sonar period, radio period and wheel lag.
const STOPS_WITHIN_S: f64 = 0.6;
/// Least free length of a drivable arc, metres.
const LEAST_FREE_M: f64 = 0.1;

#[derive(Debug)]
pub(crate) struct Arcs {
    /// Curvature of the tightest circle, 1/m.
    most_curvature: f64,
    law: MotionLaw,
}

#[derive(Clone, Copy)]
struct Followed {
    curvature: f64,
    /// Length before the first hazard.
    free_m: f64,
    progress_m: f64,
}

impl Arcs {
    /// Returns `None` for a robot that can turn on the spot.
    pub(crate) fn new(mission: &Mission) -> Option<Self> {
        let car = mission.body().ackermann()?;
        Some(Self {
            most_curvature: 1.0 / car.least_turning_radius(),
            law: MotionLaw::new(mission),
        })
    }

    /// Returns the direction of the best arc, a unit vector, and its speed limit, m/s; 0 without a
    /// drivable arc.
    pub(crate) fn advise(&self, view: &View<'_>, pose: &Pose2, distance: f64) -> (DVec2, f64) {
        assert!(distance >= 0.0 || distance.is_nan());
        let arcs = (-ARCS_A_SIDE..=ARCS_A_SIDE).map(|number| {
            let share = f64::from(number) / f64::from(ARCS_A_SIDE);
            Self::follow(view, pose, share * self.most_curvature, distance)
        });
        let best = arcs
            .filter(|arc| arc.free_m >= LEAST_FREE_M.min(distance))
            .max_by(|a, b| a.progress_m.total_cmp(&b.progress_m));
        best.map_or((pose.axis(), 0.0), |arc| {
            let limit = self.law.response.speed_to_stop_within(arc.free_m, STOPS_WITHIN_S);
            (self.direction(pose, arc.curvature, distance), limit)
        })
    }

    fn follow(view: &View<'_>, pose: &Pose2, curvature: f64, distance: f64) -> Followed {
        let mut arc = Followed { curvature, free_m: 0.0, progress_m: 0.0 };
        // A car inside a new hazard drives out of it.
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

    /// Returns the direction for which (15) and (16) give `curvature`.
    fn direction(&self, pose: &Pose2, curvature: f64, distance: f64) -> DVec2 {
        // With s the sine of the angle to the direction, the turn rate is wd s and the speed vd (1
        // - s/2), less near the target.
        let speed = self.law.speed * (distance / self.law.keys.slow_radius_m).min(1.0);
        assert!(curvature.abs() <= self.most_curvature);
        let sine = curvature * speed / (self.law.turn + curvature.abs() * speed / 2.0);
        let angle = if sine.abs() < 1.0 { sine.asin() } else { FRAC_PI_2.copysign(sine) };
        DVec2::from_angle(angle).rotate(pose.axis())
    }
}

impl View<'_> {
    /// Returns the field direction at `at`, a unit vector; zero if the field gives none.
    pub(crate) fn along(&self, at: DVec2) -> DVec2 {
        match self.guidance(at) {
            Guidance::Along(direction) | Guidance::WayOut(direction) => direction.into(),
            _ => DVec2::ZERO,
        }
    }
}
