//! Motion of a base under the control law.
//!
//! Its wheels accelerate at a limited rate. A heavy base therefore continues along its current
//! curve, and one commanded to turn on the spot hardly brakes.

use common::{
    kinematics::{FACES_COSINE, LEAST_SPEED_M_S, Pose2, TURN_GAIN, Twist},
    mission::{Base, Mission},
    samples::GuidanceStatus,
};
use glam::DVec2;

/// Status, direction and speed limit of the guidance.
pub(crate) type Advice = (GuidanceStatus, DVec2, f64);

pub(crate) const STAND: Advice = (GuidanceStatus::Waiting, DVec2::ZERO, 0.0);

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
}

impl Moving {
    pub(crate) fn is_at_rest(&self) -> bool {
        self.twist == Twist::default()
    }
}

#[derive(Debug)]
pub(crate) struct MotionModel {
    pub speed: f64,
    turn: f64,
    look: f64,
    full_speed: f64,
    turns: f64,
    base: Base,
    reach_m: f64,
    pub period_s: f64,
}

impl MotionModel {
    pub(crate) fn new(mission: &Mission) -> Self {
        let (body, hurry) = (mission.body(), mission.hurry());
        Self {
            speed: mission.speed_m_s(),
            turn: mission.turn_rad_s(),
            look: hurry.look_rad_s,
            full_speed: hurry.full_speed_within_deg.to_radians().cos(),
            turns: hurry.turns_beyond_deg.to_radians().cos(),
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
        let (status, to, limit) = advice;
        // NaN and reverse have meanings of their own.
        if limit.is_nan() || limit <= 0.0 {
            return advice;
        }
        let wanted = self.command(now.pose.axis(), advice);
        let gains_m_s = self.base.response.acceleration_m_s2 * (dead_s + self.period_s);
        let turns_m_s = self.base.wheel_m * (wanted.omega - now.twist.omega).abs();
        if turns_m_s < LEAST_SHARE * gains_m_s {
            return advice;
        }
        let most_m_s = (now.twist.v + (gains_m_s - turns_m_s).max(0.0)).max(LEAST_SPEED_M_S);
        (status, to, limit.min(most_m_s))
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
        let command = self.command(start.pose.axis(), to);
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
            Some(to) => self.base.approach(now.twist, self.command(now.pose.axis(), to), for_s),
            None => now.twist,
        };
        Moving { pose: now.pose.along_arc(twist.v * for_s, twist.omega * for_s), twist }
    }

    fn command(&self, axis: DVec2, (status, to, limit): Advice) -> Twist {
        let (cosine, sine) = (axis.dot(to), axis.perp_dot(to));
        let angle = sine.atan2(cosine).abs();
        let most = self.base.response.turn_to_stop_within(angle);
        let drives = matches!(status, GuidanceStatus::Along | GuidanceStatus::WayOut);
        let sharp = ((cosine - self.turns) / (self.full_speed - self.turns)).min(1.0);
        let (v, omega) = if to == DVec2::ZERO {
            (0.0, 0.0)
        } else if drives && limit < 0.0 {
            (limit, 0.0)
        } else if drives && sharp > 0.0 && limit >= LEAST_SPEED_M_S {
            ((self.speed * sharp).min(limit), (self.turn * sine).clamp(-most, most))
        } else if drives && cosine > FACES_COSINE {
            (0.0, 0.0)
        } else {
            (0.0, (TURN_GAIN * angle).min(self.look).min(most) * sine.signum())
        };
        Twist { v, omega }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn motion(acceleration_m_s2: f64) -> MotionModel {
        let text = format!(
            "target = [3, 0]\nrobot.model = 'jackal'\n\
             robot.response = {{ delay_s = 0.1, acceleration_m_s2 = {acceleration_m_s2} }}"
        );
        MotionModel::of_limited(&Mission::parse(&text, Path::new("m.toml")).unwrap()).unwrap()
    }

    fn moving(v: f64, omega: f64) -> Moving {
        Moving { pose: Pose2::default(), twist: Twist { v, omega } }
    }

    #[test]
    fn a_heavy_base_stands_before_its_way_to_rest_ends_in_a_thing_and_a_light_one_goes_on() {
        let ahead = (GuidanceStatus::Along, DVec2::X, 0.5);
        let wall = |pose: &Pose2, apart_m: f64| pose.position.x > 0.5 - apart_m;
        let rests = |acceleration, v| {
            let motion = motion(acceleration);
            motion.rests(moving(v, 0.0), (ahead, motion.dead_s()), wall)
        };
        assert!(!rests(0.3, 0.5) && rests(0.3, 0.2) && rests(20.0, 0.5));
    }

    #[test]
    fn a_heavy_base_brakes_before_it_turns_on_the_spot() {
        let look = (GuidanceStatus::Look, DVec2::Y, 0.0);
        let rests = |v| motion(0.3).rests(moving(v, 0.0), (look, 0.1), |_, _| false);
        assert!(!rests(0.3) && rests(0.02));
    }

    #[test]
    fn wheels_that_have_to_turn_the_robot_gain_less_speed() {
        let motion = motion(0.6);
        let limit = |omega| {
            let ahead = (GuidanceStatus::Along, DVec2::X, 2.0);
            motion.turns_too(moving(0.5, omega), motion.dead_s(), ahead).2
        };
        assert!(limit(0.0) > 0.6 && limit(1.0) < 0.51, "{} {}", limit(0.0), limit(1.0));
        let back = (GuidanceStatus::Along, DVec2::X, -0.2);
        assert_eq!(motion.turns_too(moving(0.5, 1.0), 0.1, back), back);
    }
}
