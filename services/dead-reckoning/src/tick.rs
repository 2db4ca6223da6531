use common::{clock::MissionTime, kinematics::Twist};
use serde::{Deserialize, Serialize};

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Tick {
    pub time: MissionTime,
    pub seconds: f64,
    /// By the counts of ideal wheels; metres and radians.
    pub arc: f64,
    pub turn: f64,
    /// Possible travel of each wheel with lost counts, metres.
    pub lost_m: f64,
    pub gyro: Option<GyroTurn>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct GyroTurn {
    pub turn: f64,
    pub variance: f64,
}

impl Tick {
    pub(crate) const fn moved(&self) -> Twist {
        Twist { v: self.arc, omega: self.turn }
    }
}
