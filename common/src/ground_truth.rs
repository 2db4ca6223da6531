//! Ground truth of a simulated robot as JSON lines: a [`GroundTruthHeader`], then one
//! [`GroundTruthTick`] each. Stages never read it.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{kinematics::Pose2, samples::PoseSample};

pub const GROUND_TRUTH: &str = "ground_truth.jsonl";

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroundTruthHeader {
    pub listening: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub laser: Option<String>,
}

/// State when the tick's frames are made; tick 0 precedes any motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GroundTruthTick {
    pub tick: u64,
    pub time_s: f64,
    /// Robot's centre in the mission frame, metres.
    pub x: f64,
    pub y: f64,
    /// Radians counter-clockwise from x, not wrapped.
    pub heading: f64,
    pub v: f64,
    /// rad/s.
    pub omega: f64,
    /// Least distance from the body's surface to any obstacle since the last tick, metres; or
    /// [`GroundTruthTick::NOTHING_NEAR`].
    pub clearance_m: f64,
    pub contacts: u64,
    /// Encoder counts in this tick's frame, growing forward, modulo 32768.
    pub left_counts: u16,
    pub right_counts: u16,
    /// Front ultrasonic byte of this tick's frame; 255 means no echo.
    pub sonar_cm: u8,
    /// Longest time that a wheel turned after the last received motion command, seconds. At rest
    /// means below [`GroundTruthTick::AT_REST_M_S`].
    #[serde(default)]
    pub stopping_time_s: f64,
    /// Absent with a perfect radio.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radio: Option<GroundTruthRadio>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GroundTruthRadio {
    pub out: bool,
    pub sent: u64,
    pub lost: u64,
    pub longest_outage_s: f64,
    /// Earlier ticks whose frames were lost, in lockstep.
    #[serde(default)]
    pub missed_ticks: u64,
}

impl GroundTruthTick {
    /// Speed of a wheel's rim, m/s.
    pub const AT_REST_M_S: f64 = 0.01;
    /// Metres; JSON has no infinity.
    pub const NOTHING_NEAR: f64 = 1e9;

    /// Returns the number among ticks with received frames, which poses count in lockstep. A tick
    /// with lost frames has the next one's number.
    pub const fn heard_tick(&self) -> u64 {
        match self.radio {
            Some(radio) => self.tick.saturating_sub(radio.missed_ticks),
            None => self.tick,
        }
    }

    pub const fn pose(&self) -> Pose2 {
        Pose2 { position: DVec2::new(self.x, self.y), heading: self.heading }
    }

    pub const fn is_of(&self, pose: &PoseSample) -> bool {
        self.left_counts == pose.left_counts && self.right_counts == pose.right_counts
    }

    /// Returns the speed of the faster wheel's rim.
    pub fn rim_m_s(&self, track_m: f64) -> f64 {
        self.v.abs() + self.omega.abs() * track_m / 2.0
    }

    pub fn pose_error_m(&self, pose: &PoseSample) -> f64 {
        (pose.x_m - self.x).hypot(pose.y_m - self.y)
    }
}
