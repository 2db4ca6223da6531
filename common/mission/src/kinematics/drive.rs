use super::{ackermann::Ackermann, differential::DifferentialDrive, pose::Twist};

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drive {
    Differential(DifferentialDrive),
    Ackermann(Ackermann),
}

impl Drive {
    /// Applies (17) within the drive's limits. Returns the left and right wheel, rad/s, or for a
    /// car the driven wheel, rad/s, and the steering angle, radians, positive to the left.
    pub fn inputs(&self, twist: Twist) -> [f64; 2] {
        match self {
            Self::Differential(drive) => drive.wheels(twist),
            Self::Ackermann(drive) => drive.wheel(twist),
        }
    }
}
