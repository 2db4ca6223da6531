use common::{clock::MissionTime, kinematics::Twist};
use serde::{Deserialize, Serialize};

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Tick {
    pub(crate) time: MissionTime,
    pub(crate) seconds: f64,
    /// By the counts of ideal wheels; metres and radians.
    pub(crate) arc: f64,
    pub(crate) turn: f64,
    /// Possible travel of each wheel with lost counts, metres.
    pub(crate) lost_m: f64,
    pub(crate) gyro: Option<GyroTurn>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct GyroTurn {
    pub(crate) turn: f64,
    pub(crate) variance: f64,
}

impl Tick {
    pub(crate) const fn moved(&self) -> Twist {
        Twist { v: self.arc, omega: self.turn }
    }
}
