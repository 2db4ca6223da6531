//! The ground truth of a simulated robot: one JSON object a line, for the summary and the pictures.
//!
//! The first line is a [`GroundTruthHeader`], every further one a [`GroundTruthTick`]. No stage reads it.

use serde::{Deserialize, Serialize};

use crate::samples::PoseSample;

/// The file in the run directory with the lines of ticks.
pub const GROUND_TRUTH: &str = "ground_truth.jsonl";

/// The first line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroundTruthHeader {
    /// Where the robot answers, `address:port`.
    pub listening: String,
}

/// One line a tick, written when the tick's frames are made; tick 0 comes before anything has moved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GroundTruthTick {
    /// Number of the tick.
    pub tick: u64,
    /// Mission time, seconds.
    pub time_s: f64,
    /// Position of the robot's centre in the mission frame, metres.
    pub x: f64,
    /// See `x`.
    pub y: f64,
    /// Heading, radians counter-clockwise from x, not wrapped.
    pub heading: f64,
    /// Speed along the heading, m/s.
    pub v: f64,
    /// Turn rate, rad/s.
    pub omega: f64,
    /// Least distance since the tick before from the body's surface to the nearest thing, metres;
    /// [`GroundTruthTick::NOTHING_NEAR`] where nothing stands.
    pub clearance_m: f64,
    /// How often the body has touched something so far.
    pub contacts: u64,
    /// Left wheel counts as this tick's frame shows them, growing forward, modulo 32768.
    pub left_counts: u16,
    /// Right wheel counts, like `left_counts`.
    pub right_counts: u16,
    /// The front ultrasonic byte of this tick's frame, centimetres; 255 is nothing.
    pub sonar_cm: u8,
    /// The longest time so far that a wheel turned after the last motion command the robot received, seconds. A wheel slower
    /// than [`GroundTruthTick::AT_REST_M_S`] is at rest.
    #[serde(default)]
    pub stopping_time_s: f64,
    /// The losses of the radio so far; missing where it is perfect.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radio: Option<GroundTruthRadio>,
}

/// The losses of the radio so far, both ways together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GroundTruthRadio {
    /// Whether the radio is out now.
    pub out: bool,
    /// Datagrams sent.
    pub sent: u64,
    /// Datagrams lost.
    pub lost: u64,
    /// The longest outage, seconds.
    pub longest_outage_s: f64,
    /// Ticks before this one whose frames were lost, in lockstep.
    #[serde(default)]
    pub missed_ticks: u64,
}

impl GroundTruthTick {
    /// A wheel whose rim is slower than this is at rest, m/s.
    pub const AT_REST_M_S: f64 = 0.01;
    /// Clearance where nothing stands, metres: JSON has no infinity.
    pub const NOTHING_NEAR: f64 = 1e9;

    /// The number of this tick if only ticks count whose frames were received: its pose has this number, in lockstep. A tick
    /// whose frames were lost has the number of the next one.
    pub const fn heard_tick(&self) -> u64 {
        match self.radio {
            Some(radio) => self.tick.saturating_sub(radio.missed_ticks),
            None => self.tick,
        }
    }

    /// Whether this tick is that of `pose`, by the wheel counts of both.
    pub const fn is_of(&self, pose: &PoseSample) -> bool {
        self.left_counts == pose.left_counts && self.right_counts == pose.right_counts
    }

    /// How far `pose` is from the true position, metres.
    pub fn pose_error_m(&self, pose: &PoseSample) -> f64 {
        (pose.x_m - self.x).hypot(pose.y_m - self.y)
    }
}
