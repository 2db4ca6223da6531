use glam::DVec2;
use serde::{Deserialize, Serialize};

/// Pose of the robot's centre in the mission frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose2 {
    /// Metres.
    pub position: DVec2,
    /// theta, radians counter-clockwise from x.
    pub heading: f64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// m/s.
    pub v: f64,
    /// rad/s.
    pub omega: f64,
}

impl Pose2 {
    pub fn axis(&self) -> DVec2 {
        DVec2::from_angle(self.heading)
    }

    /// Integrates (1) exactly for constant v and omega: `arc` metres along a circle while turning
    /// by `turn` radians.
    pub fn along_arc(&self, arc: f64, turn: f64) -> Self {
        // sin(h)/h, the chord over its arc, stable through h = 0.
        let half = turn / 2.0;
        let chord = if half.abs() < 1e-6 { 1.0 - half * half / 6.0 } else { half.sin() / half };
        debug_assert!(chord <= 1.0 || chord.is_nan());
        Self {
            position: self.position + DVec2::from_angle(self.heading + half) * (arc * chord),
            heading: self.heading + turn,
        }
    }

    /// Applies one forward Euler step of (21) along the heading before the turn.
    pub fn along_euler(&self, arc: f64, turn: f64) -> Self {
        Self { position: self.position + self.axis() * arc, heading: self.heading + turn }
    }
}
