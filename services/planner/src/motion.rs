//! Motion of a base under the control law.
//!
//! Its wheels accelerate at a limited rate. A heavy base therefore continues along its current
//! curve, and one commanded to turn on the spot hardly brakes.

use common::{
    kinematics::{LEAST_SPEED_M_S, Pose2, Twist},
    mission::{Base, Mission},
    motion_law::{Alignment, MotionLaw},
    samples::{GuidanceStatus, Maneuver},
};
use glam::DVec2;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Advice {
    pub status: GuidanceStatus,
    pub maneuver: Maneuver,
    /// Unit vector, or 0 for none.
    pub to: DVec2,
    /// Speed limit, m/s.
    pub limit: f64,
}

impl Advice {
    pub(crate) const fn new(status: GuidanceStatus, to: DVec2, limit: f64) -> Self {
        Self { status, maneuver: status.maneuver(), to, limit }
    }

    pub(crate) const fn along(to: DVec2, limit: f64) -> Self {
        Self::new(GuidanceStatus::Along, to, limit)
    }

    pub(crate) const fn back(axis: DVec2, limit: f64) -> Self {
        Self { maneuver: Maneuver::Back, ..Self::along(axis, limit) }
    }

    pub(crate) fn slower(self, share: f64) -> Self {
        Self { limit: share * self.limit, ..self }
    }
}

pub(crate) const STAND: Advice = Advice::new(GuidanceStatus::Waiting, DVec2::ZERO, 0.0);

pub(crate) const STEP_S: f64 = 0.1;
/// Limit of the predicted time to rest, seconds.
const RESTS_WITHIN_S: f64 = 12.0;
/// Stopping distance below which the map sees no motion, metres: half a cell.
const LEAST_WAY_M: f64 = 0.025;
/// Uncertainty as a share of the motion until rest or within `MOST_DOUBTED_S`, seconds.
const DOUBT: f64 = 0.1;
const MOST_DOUBTED_S: f64 = 1.0;
/// Share of the wheels' speed gain below which a turn is ignored.
const LEAST_SHARE: f64 = 0.1;

#[derive(Clone, Copy)]
pub(crate) struct Moving {
    pub pose: Pose2,
    pub twist: Twist,
    /// Place of the target, before which the robot slows down.
    pub target: DVec2,
}

impl Moving {
    pub(crate) fn is_at_rest(&self) -> bool {
        self.twist == Twist::default()
    }
}

#[derive(Debug)]
pub(crate) struct MotionModel {
    pub law: MotionLaw,
    base: Base,
    reach_m: f64,
    pub period_s: f64,
}

impl MotionModel {
    pub(crate) fn new(mission: &Mission) -> Self {
        let body = mission.body();
        Self {
            law: MotionLaw::new(mission),
            base: Base::new(mission.trusted_response(), body.track_m),
            reach_m: body.radius_m,
            period_s: 1.0 / mission.robot.rate_hz,
        }
    }

    /// Returns `None` for a base without a known acceleration limit.
    pub(crate) fn of_limited(mission: &Mission) -> Option<Self> {
        let motion = Self::new(mission);
        motion.base.is_limited().then_some(motion)
    }

    pub(crate) fn dead_s(&self) -> f64 {
        self.base.response.dead_time_s()
    }

    /// Limits the speed of `advice` so that the wheels can also turn as the controller asks.
    ///
    /// Wheels that accelerate at their limit have no reserve to turn the robot.
    pub(crate) fn turns_too(&self, now: Moving, dead_s: f64, advice: Advice) -> Advice {
        if advice.maneuver != Maneuver::Follow {
            return advice;
        }
        let wanted = self.command(now, advice);
        let gains_m_s = self.base.response.acceleration_m_s2 * (dead_s + self.period_s);
        let turns_m_s = self.base.wheel_m * (wanted.omega - now.twist.omega).abs();
        if turns_m_s < LEAST_SHARE * gains_m_s {
            return advice;
        }
        let most_m_s = (now.twist.v + (gains_m_s - turns_m_s).max(0.0)).max(LEAST_SPEED_M_S);
        Advice { limit: advice.limit.min(most_m_s), ..advice }
    }

    /// Returns whether a robot that follows `to` for one more tick then rests without a touch.
    ///
    /// The command acts `dead_s` after `start`. A robot that touches now may leave.
    pub(crate) fn rests(
        &self,
        start: Moving,
        (to, dead_s): (Advice, f64),
        touches: impl Fn(&Pose2, f64) -> bool,
    ) -> bool {
        let Twist { v, omega } = start.twist;
        let command = self.command(start, to);
        // A wheel that turns ahead cannot brake.
        let on_the_spot = command.v == 0.0 && command.omega != 0.0;
        if on_the_spot && v > self.base.response.acceleration_m_s2 * self.period_s {
            return false;
        }
        let motion_m_s = v.abs() + self.reach_m * omega.abs();
        let rests_s =
            (v.abs() + self.base.wheel_m * omega.abs()) / self.base.response.acceleration_m_s2;
        if motion_m_s * rests_s / 2.0 < LEAST_WAY_M || touches(&start.pose, 0.0) {
            return true;
        }
        let doubt_m = DOUBT * motion_m_s * rests_s.min(MOST_DOUBTED_S);
        let touches = |pose: &Pose2| touches(pose, doubt_m);
        let mut now = start;
        for step in 1..=(RESTS_WITHIN_S / STEP_S) as u32 {
            let at_s = STEP_S * f64::from(step);
            let acts =
                (at_s > dead_s).then_some(if at_s <= dead_s + self.period_s { to } else { STAND });
            now = self.next(now, STEP_S, acts);
            if touches(&now.pose) {
                return false;
            }
            if now.is_at_rest() && at_s > dead_s + self.period_s {
                break;
            }
        }
        true
    }

    /// Predicts the motion after `for_s` seconds towards `to`; `None` continues the current twist.
    pub(crate) fn next(&self, now: Moving, for_s: f64, to: Option<Advice>) -> Moving {
        let twist = match to {
            Some(to) => self.base.approach(now.twist, self.command(now, to), for_s),
            None => now.twist,
        };
        Moving { pose: now.pose.along_arc(twist.v * for_s, twist.omega * for_s), twist, ..now }
    }

    fn command(&self, now: Moving, Advice { maneuver, to, limit, .. }: Advice) -> Twist {
        if to == DVec2::ZERO {
            return Twist::default();
        }
        let Moving { pose, twist, target } = now;
        let alignment = Alignment::of(pose.axis(), to);
        let distance = pose.position.distance(target);
        // The controller keeps the side of a turning robot.
        let mut side = 1_f64.copysign(twist.omega);
        self.law.twist(maneuver, alignment, distance, limit, &mut side).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::mission;

    fn motion(acceleration_m_s2: f64) -> MotionModel {
        let text = format!(
            "target = [3, 0]\nrobot.model = 'jackal'\n\
             robot.response = {{ delay_s = 0.1, acceleration_m_s2 = {acceleration_m_s2} }}"
        );
        MotionModel::of_limited(&mission(&text)).unwrap()
    }

    fn moving(v: f64, omega: f64) -> Moving {
        Moving { pose: Pose2::default(), twist: Twist { v, omega }, target: 9.0 * DVec2::X }
    }

    #[test]
    fn a_heavy_base_stands_before_its_way_to_rest_ends_in_a_thing_and_a_light_one_goes_on() {
        let ahead = Advice::along(DVec2::X, 0.5);
        let wall = |pose: &Pose2, apart_m: f64| pose.position.x > 0.5 - apart_m;
        let rests = |acceleration, v| {
            let motion = motion(acceleration);
            motion.rests(moving(v, 0.0), (ahead, motion.dead_s()), wall)
        };
        assert!(!rests(0.3, 0.5) && rests(0.3, 0.2) && rests(20.0, 0.5));
    }

    #[test]
    fn wheels_that_have_to_turn_the_robot_gain_less_speed() {
        let motion = motion(0.6);
        let limit = |omega| {
            let ahead = Advice::along(DVec2::X, 2.0);
            motion.turns_too(moving(0.5, omega), motion.dead_s(), ahead).limit
        };
        assert!(limit(0.0) > 0.6 && limit(1.0) < 0.51);
        let back = Advice::back(DVec2::X, 0.2);
        assert_eq!(motion.turns_too(moving(0.5, 1.0), 0.1, back), back);
    }
}
