//! The rigid motion of the robot, (1), and the two maps G between what is driven and the body, (2), (3), with
//! their inverses, (17).

mod ackermann;
mod differential;
mod drive;
mod pose;

pub use ackermann::{Ackermann, SteeredWheel};
pub use differential::{DifferentialDrive, WheelSpeeds};
pub use drive::Drive;
pub use pose::{Pose2, Twist};
