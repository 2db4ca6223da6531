//! The pose at which a command will act, for planner and controller. A base that answers late turns past its direction, and drives on
//! towards what is near, if each command is computed for the pose that was seen: the commands that it has not answered yet are foreseen
//! by its response. A base that answers soon goes by the pose that was seen: a Jackal was a sixth slower with the lead.

use crate::{
    Mission, ModelledSpeed, Response,
    kinematics::{DifferentialDrive, Drive, Pose2, TURN_GAIN, Twist},
};

/// A proportional law is well damped up to this product of its gain and the dead time; it oscillates for ever from pi / 2 on.
const DAMPED: f64 = 0.5;
/// Steps in which the way ahead is integrated, seconds.
const STEP_S: f64 = 0.02;

#[derive(Clone, Debug)]
pub struct Lead {
    drive: DifferentialDrive,
    dead_time_s: f64,
    v: ModelledSpeed,
    omega: ModelledSpeed,
}

impl Lead {
    /// None for a base that answers soon enough, and for a car.
    pub fn new(mission: &Mission) -> Option<Self> {
        let body = mission.body();
        let dead_time_s = body.response.dead_time_s();
        let Response { acceleration_m_s2, turn_acceleration_rad_s2, .. } = body.response;
        let Drive::Differential(drive) = body.drive() else {
            return None;
        };
        (dead_time_s * TURN_GAIN > DAMPED).then(|| Self {
            drive,
            dead_time_s,
            v: ModelledSpeed::new(dead_time_s, acceleration_m_s2),
            omega: ModelledSpeed::new(dead_time_s, turn_acceleration_rad_s2),
        })
    }

    pub const fn dead_time_s(&self) -> f64 {
        self.dead_time_s
    }

    /// The pose at which a command acts that is given at the time `now_s` of `pose`.
    pub fn pose(&mut self, pose: Pose2, now_s: f64) -> Pose2 {
        self.v.go_on(now_s);
        self.omega.go_on(now_s);
        let Self { dead_time_s, mut v, mut omega, .. } = self.clone();
        let steps = (dead_time_s / STEP_S).ceil();
        (1..=steps as u32).fold(pose, |pose, step| {
            let until_s = now_s + dead_time_s * f64::from(step) / steps;
            pose.along_arc(v.go_on(until_s), omega.go_on(until_s))
        })
    }

    /// `twist` was commanded for a pose of that time. Its curve is driven no faster than the wheels turn.
    pub fn command(&mut self, twist: Twist, now_s: f64) {
        let twist = self.drive.twist(self.drive.wheels(twist));
        self.v.command(now_s, twist.v);
        self.omega.command(now_s, twist.omega);
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn lead(text: &str) -> Option<Lead> {
        let text = format!(
            "target = [3, 0]\ncontroller.speed_m_s = 0.5\nrobot.top_speed_m_s = 0.5\n{text}"
        );
        Lead::new(&Mission::parse(&text, Path::new("m.toml")).unwrap())
    }

    #[test]
    fn a_late_base_is_foreseen_on_the_curve_of_the_commands_that_it_has_not_answered_yet() {
        assert!(lead("").is_none());
        let mut lead = lead("robot.response = { delay_s = 0.4, lag_s = 0.1 }").unwrap();
        let at = |lead: &mut Lead, now_s| lead.pose(Pose2::default(), now_s);
        assert_eq!(at(&mut lead, 0.0), Pose2::default());
        lead.command(Twist { v: 0.2, omega: 0.5 }, 0.0);
        lead.command(Twist { v: 0.0, omega: 0.0 }, 0.4);
        let pose = at(&mut lead, 0.5);
        let close = |got: f64, want: f64| assert!((got - want).abs() < 1e-9, "{got} {want}");
        close(pose.heading, 0.2);
        close(pose.position.x, 0.4 * 0.2_f64.sin());
        // Wheels that cannot turn so fast keep the curve.
        lead.command(Twist { v: 1.0, omega: 1.0 }, 1.0);
        let Pose2 { position, heading } = at(&mut lead, 1.5);
        assert!(heading > 0.1 && position.length() < 0.26, "{position} {heading}");
        close(position.x, heading.sin());
    }
}
