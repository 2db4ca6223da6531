//! The state of a simulated robot that its next process restores: its pose, and the counts of its wheels.
//!
//! A real robot stands where it came to rest when its host went away. A simulated one whose process ends with its
//! supervisor's comes to rest at once, and its next process begins there. By then nothing is under way: no order, no
//! wheel speed, no datagram in flight. The random streams of its sensors begin anew, but not as they began before.

use common::kinematics::Pose2;
use serde::{Deserialize, Serialize};

/// The greatest size of an encoded [`SavedState`], bytes.
pub(crate) const CAPACITY: usize = 256;

/// A simulated robot at rest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedState {
    /// The last tick.
    pub(crate) tick: u64,
    /// Mission time of that tick, seconds.
    pub(crate) time_s: f64,
    /// Pose of the body, mission frame.
    pub(crate) pose: Pose2,
    /// Counts of each motor channel since boot.
    pub(crate) turned: [f64; 6],
    /// Times the body has touched something.
    pub(crate) contacts: u64,
    /// For each ultrasonic ranger, whether it is in a run of silence.
    pub(crate) silent: [bool; 6],
    /// The longest time that a wheel turned after the last motion command, seconds.
    pub(crate) stopping_time_s: f64,
}
