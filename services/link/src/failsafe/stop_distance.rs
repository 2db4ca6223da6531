//! How far the robot goes from a fault until it rests, at its full speed: the time until the link knows of the fault, and the base's way
//! to stop. What no time bounds, or an operator or another commander does, is not here.

use common::{mission::Mission, samples::Cause};

use super::{Rule, TABLE};

/// Each cause that stops the robot for which the time is bounded: that time, seconds, and the way from the fault to rest, metres.
pub fn from_faults(mission: &Mission) -> Vec<(Cause, f64, f64)> {
    let response = mission.body().response;
    let row = |rule: &Rule| {
        let known_s = rule.known_within_s?(mission);
        let after_s = known_s + response.dead_time_s();
        Some((rule.cause, known_s, response.way_to_stop_m(mission.speed_m_s(), after_s)))
    };
    TABLE.iter().filter_map(row).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn the_way_from_a_fault_to_rest_grows_with_the_speed_the_limit_of_commands_and_a_heavier_base()
    {
        let way = |text: &str| {
            let text = format!("target = [3, 0]\n{text}");
            let mission = Mission::parse(&text, Path::new("m.toml")).unwrap();
            let ways = from_faults(&mission);
            ways.into_iter().find(|(cause, ..)| *cause == Cause::CommandStale).unwrap().2
        };
        let usual = way("controller.speed_m_s = 0.4");
        assert!((usual - 0.4 * (0.25 + 0.15)).abs() < 1e-9, "{usual}");
        assert!(way("controller.speed_m_s = 0.6") > usual);
        assert!(way("controller.speed_m_s = 0.4\nrobot.command_limit_s = 0.5") > usual);
        let heavy = way("controller.speed_m_s = 0.4\nrobot.response.acceleration_m_s2 = 0.6");
        assert!((heavy - usual - 0.4 * 0.4 / 1.2).abs() < 1e-9, "{heavy}");
    }
}
