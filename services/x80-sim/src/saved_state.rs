//! The pose and wheel counts that a simulated robot's next process restores.
//!
//! Like a real robot whose host went away, it comes to rest, at once, and its next process begins there. By then
//! nothing is under way: no order, no wheel speed, no datagram. The random streams of its sensors begin anew, but not
//! as they began before.

use common::kinematics::Pose2;
use serde::{Deserialize, Serialize};

pub(crate) const CAPACITY: usize = 256;

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedState {
    pub(crate) tick: u64,
    pub(crate) time_s: f64,
    pub(crate) pose: Pose2,
    /// Each motor channel's counts since boot.
    pub(crate) turned: [f64; 6],
    pub(crate) contacts: u64,
    /// Each ultrasonic ranger in a run of silence.
    pub(crate) silent: [bool; 6],
    /// A wheel turned at most so long after the last motion command.
    pub(crate) stopping_time_s: f64,
}
