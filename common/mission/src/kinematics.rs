//! The rigid motion of the robot, (1), the maps G from what is driven to the body, (2), (3), and their inverses,
//! (17).

mod ackermann;
mod differential;
mod drive;
mod pose;

pub use ackermann::Ackermann;
pub use differential::DifferentialDrive;
pub use drive::Drive;
pub use pose::{Pose2, Twist};

/// Below this speed, m/s, a wheel may stick in the dead band of its loop (20 counts/s after a gain of 0.78, 11 mm/s).
/// A lower speed limit means stand.
pub const LEAST_SPEED_M_S: f64 = 0.04;

/// Within 11 degrees a robot faces its way: it does not turn on the spot, and where it may not go on it stands.
pub const FACES_COSINE: f64 = 0.98;

/// The controller's turn rate on the spot per remaining angle, 1/s.
pub const TURN_GAIN: f64 = 3.0;
