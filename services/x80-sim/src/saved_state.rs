//! The state of a simulated robot that its next process restores: where it stands, and what its wheels have counted.
//!
//! A real robot stands where it came to rest when its host went away. A simulated one whose process ends with
//! its supervisor's comes to rest at once, and its next process begins there. What was under way (an order, a
//! wheel's speed, a datagram in flight) is gone by then; the random streams of its sensors begin anew, but not
//! as they began before.

use common::kinematics::Pose2;
use serde::{Deserialize, Serialize};

/// Room for the encoded [`SavedState`], bytes.
pub(crate) const CAPACITY: usize = 256;

/// A simulated robot at rest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedState {
    /// The last tick.
    pub(crate) tick: u64,
    /// Its mission time, seconds.
    pub(crate) time_s: f64,
    /// Where the body is, mission frame.
    pub(crate) pose: Pose2,
    /// Counts of each motor channel since boot.
    pub(crate) turned: [f64; 6],
    /// How often the body has touched something.
    pub(crate) contacts: u64,
    /// Which ultrasonic rangers are in a run of silence.
    pub(crate) silent: [bool; 6],
    /// The longest that a wheel turned after the last motion command, seconds.
    pub(crate) stopping_time_s: f64,
}
