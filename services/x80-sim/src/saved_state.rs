//! Pose and wheel counts that a simulated robot's next process restores.
//!
//! A robot without a host comes to rest, and its next process begins there, without pending orders,
//! speeds or datagrams. The sensors' random streams restart with other numbers.

use common::kinematics::Pose2;
use serde::{Deserialize, Serialize};

pub const CAPACITY: usize = 256;

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedState {
    pub tick: u64,
    pub time_s: f64,
    pub pose: Pose2,
    /// Counts of each motor channel since boot.
    pub turned: [f64; 6],
    pub contacts: u64,
    pub silent: [bool; 6],
    /// Maximum time that a wheel turned after the last motion command.
    pub stopping_time_s: f64,
}
