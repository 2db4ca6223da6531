//! One tick as the filter takes it.

use common::{clock::MissionTime, kinematics::Twist};
use serde::{Deserialize, Serialize};

/// One tick: the motion since the tick before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Tick {
    pub(crate) time: MissionTime,
    pub(crate) seconds: f64,
    /// Arc and turn by the counts, for wheels without errors: metres and radians.
    pub(crate) arc: f64,
    pub(crate) turn: f64,
    /// The way that each wheel may have rolled with its counts lost, metres.
    pub(crate) lost_m: f64,
    pub(crate) gyro: Option<GyroTurn>,
}

/// The turn of a tick by a gyro.
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
