//! Distance and time from a fault to rest at full speed: the time until the link knows, and the
//! base's stopping distance. Unbounded faults and other commanders are excluded.

use common::{ground_truth::GroundTruthTick, mission::Mission, samples::Cause};

use super::{TABLE, rule};

#[derive(Clone, Copy, Debug)]
pub struct Stop {
    /// Time until the link commands a stop, or its last command expires.
    pub known_s: f64,
    /// Time until the wheels rest.
    pub rest_s: f64,
    pub way_m: f64,
}

impl Stop {
    pub fn known_after(known_s: f64, mission: &Mission) -> Self {
        let response = mission.trusted_response();
        let speed = mission.speed_m_s();
        assert!(known_s >= 0.0 && speed >= 0.0);
        let turns_s = mission.turn_rad_s() / response.turn_acceleration_rad_s2;
        let brakes_s = turns_s.max(speed / response.acceleration_m_s2);
        // A lag takes this many time constants to decay to rest.
        let lags_s = response.lag_s * (speed / GroundTruthTick::AT_REST_M_S).ln().max(0.0);
        Self {
            known_s,
            rest_s: known_s + response.delay_s + lags_s + brakes_s,
            way_m: response.way_to_stop_m(speed, known_s + response.dead_time_s()),
        }
    }

    /// None if unbounded.
    pub fn by(cause: Cause, mission: &Mission) -> Option<Self> {
        Some(Self::known_after(rule(cause)?.known_within_s?(mission), mission))
    }
}

/// Returns the causes that stop the robot within a bounded time.
pub fn from_faults(mission: &Mission) -> Vec<(Cause, Stop)> {
    let causes = TABLE.iter().map(|rule| rule.cause);
    causes.filter_map(|cause| Some((cause, Stop::by(cause, mission)?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::near;

    fn mission(text: &str) -> Mission {
        crate::testing::mission(&format!("controller.turn_rad_s = 0.8\n{text}"))
    }

    fn stale(text: &str) -> Stop {
        Stop::by(Cause::CommandStale, &mission(text)).unwrap()
    }

    #[test]
    fn the_way_from_a_fault_to_rest_grows_with_the_speed_the_limit_of_commands_and_a_heavier_base()
    {
        let way = |text| stale(text).way_m;
        let usual = way("controller.speed_m_s = 0.4");
        near(usual, 0.4 * (0.25 + 0.15), 1e-9);
        assert!(way("controller.speed_m_s = 0.6") > usual);
        assert!(way("controller.speed_m_s = 0.4\nrobot.command_limit_s = 0.5") > usual);
        let heavy = way("controller.speed_m_s = 0.4\nrobot.response.acceleration_m_s2 = 0.6");
        near(heavy - usual, 0.4 * 0.4 / 1.2, 1e-9);
    }

    #[test]
    fn a_robot_that_does_not_stop_is_known_after_lost_stops_its_braking_and_two_frames() {
        let slow = mission("controller.speed_m_s = 0.4\nrobot.response.acceleration_m_s2 = 0.5");
        let known_s = Stop::by(Cause::RobotDoesNotStop, &slow).unwrap().known_s;
        let late_s = slow.trusted_response().dead_time_s();
        near(known_s - late_s, 0.45 + 0.8 + 0.5 + 2.0 / 7.0, 1e-9);
    }

    #[test]
    fn the_time_from_a_fault_to_rest_grows_with_the_delay_the_lag_and_a_heavier_base() {
        let rest = |response: &str| {
            stale(&format!("controller.speed_m_s = 0.4\nrobot.response = {{ {response} }}")).rest_s
        };
        let light = rest("delay_s = 0.1, lag_s = 0.0");
        near(light, 0.35, 1e-9);
        near(rest("delay_s = 0.3, lag_s = 0.0") - light, 0.2, 1e-9);
        // The speed falls to a fortieth.
        near(rest("delay_s = 0.1, lag_s = 0.1") - light, 0.1 * 40_f64.ln(), 1e-9);
        let heavy = rest("delay_s = 0.1, lag_s = 0.0, acceleration_m_s2 = 0.5");
        near(heavy - light, 0.8, 1e-9);
    }
}
