//! How far the robot goes from a fault until it rests, at its full speed: the time until the link knows of the fault, and the base's way
//! to stop. What no time bounds, or an operator or another commander does, is not here.

use common::{mission::Mission, samples::Cause};

use super::{
    TABLE, battery, contact, odometry,
    orders::SUPERVISOR_SILENT,
    presence::SILENT_LIMITS,
    range::WAY_M,
    streams::{INTERVALS, SHORT_ONES},
};

/// The time from the fault until the link tells the robot to stand, or the robot's last command is over, seconds.
fn noticed_within_s(cause: Cause, mission: &Mission) -> Option<f64> {
    let limit_s = mission.robot.command_limit_s;
    let settled_s = mission.body().response.dead_time_s();
    Some(match cause {
        Cause::BatteryEmpty => battery::EMPTY_AFTER.as_secs_f64(),
        Cause::SupervisorSilent => SUPERVISOR_SILENT.as_secs_f64(),
        // Without frames there are no ticks, and without ticks no commands.
        Cause::RobotLost
        | Cause::FramesSilent
        | Cause::CommandStale
        | Cause::PoseStale
        | Cause::GuidanceStale => limit_s,
        Cause::FramesSlow => limit_s * (INTERVALS - SHORT_ONES) as f64,
        Cause::RangeSilent => limit_s * f64::from(SILENT_LIMITS),
        Cause::RangeImplausible => WAY_M / mission.speed_m_s(),
        Cause::OdometryImplausible => settled_s + odometry::SUSPECTED_AFTER.as_secs_f64(),
        Cause::WheelsHeld => settled_s + contact::HELD_AFTER.as_secs_f64(),
        _ => return None,
    })
}

/// Each cause that stops the robot for which the time is bounded: that time, seconds, and the way from the fault to rest, metres.
pub fn from_faults(mission: &Mission) -> Vec<(Cause, f64, f64)> {
    let response = mission.body().response;
    let row = |cause: Cause| {
        let noticed_s = noticed_within_s(cause, mission)?;
        let after_s = noticed_s + response.dead_time_s();
        Some((cause, noticed_s, response.way_to_stop_m(mission.speed_m_s(), after_s)))
    };
    TABLE.iter().filter_map(|rule| row(rule.cause)).collect()
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
