//! Rigid motion of the robot (1), the maps G from inputs to the body (2), (3), and their inverses
//! (17).

mod ackermann;
mod differential;
mod drive;
mod pose;

pub use ackermann::Ackermann;
pub use differential::DifferentialDrive;
pub use drive::Drive;
pub use pose::{Pose2, Twist};

/// Least usable speed, m/s; a lower speed limit means standstill. Slower wheels may stick in the
/// dead band of their loop (20 counts/s after a gain of 0.78, 11 mm/s).
pub const LEAST_SPEED_M_S: f64 = 0.04;

/// Cosine of 11 degrees, within which the robot faces its way: on a blocked way it stands instead
/// of turning on the spot.
pub const FACES_COSINE: f64 = 0.98;

/// Gain of the controller's turn on the spot, 1/s.
pub const TURN_GAIN: f64 = 3.0;
