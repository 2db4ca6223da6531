//! The pose at which a command will act. A base that answers late turns past its direction if each command is computed for the pose that
//! was seen: the commands that it has not answered yet are foreseen by its response. A base that answers soon is led by the pose that
//! was seen, because the direction was computed for its place: a Jackal was a sixth slower with the lead.

use common::{
    kinematics::{Pose2, Twist},
    mission::{Mission, ModelledSpeed, Response},
};

use super::TURN_GAIN;

/// A proportional law is well damped up to this product of its gain and the dead time; it oscillates for ever from pi / 2 on.
const DAMPED: f64 = 0.5;
/// Steps in which the way ahead is integrated, seconds.
const STEP_S: f64 = 0.02;

#[derive(Clone, Debug)]
pub(super) struct Lead {
    dead_time_s: f64,
    v: ModelledSpeed,
    omega: ModelledSpeed,
}

impl Lead {
    /// None for a base that answers soon enough.
    pub(super) fn new(mission: &Mission) -> Option<Self> {
        let response = mission.body().response;
        let dead_time_s = response.dead_time_s();
        let Response { acceleration_m_s2, turn_acceleration_rad_s2, .. } = response;
        (dead_time_s * TURN_GAIN > DAMPED).then(|| Self {
            dead_time_s,
            v: ModelledSpeed::new(dead_time_s, acceleration_m_s2),
            omega: ModelledSpeed::new(dead_time_s, turn_acceleration_rad_s2),
        })
    }

    /// The pose at which a command acts that is given at the time `now_s` of `pose`.
    pub(super) fn pose(&mut self, pose: Pose2, now_s: f64) -> Pose2 {
        self.v.go_on(now_s);
        self.omega.go_on(now_s);
        let Self { dead_time_s, mut v, mut omega } = self.clone();
        let steps = (dead_time_s / STEP_S).ceil();
        (1..=steps as u32).fold(pose, |pose, step| {
            let until_s = now_s + dead_time_s * f64::from(step) / steps;
            pose.along_arc(v.go_on(until_s), omega.go_on(until_s))
        })
    }

    pub(super) fn command(&mut self, twist: Twist, now_s: f64) {
        self.v.command(now_s, twist.v);
        self.omega.command(now_s, twist.omega);
    }
}
