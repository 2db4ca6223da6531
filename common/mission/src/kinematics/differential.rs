//! The differential drive, (2), and its inverse, (17).

use nalgebra::{Matrix2, Vector2};

use super::pose::Twist;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferentialDrive {
    g: Matrix2<f64>,
    inverse: Matrix2<f64>,
    rim_limit: f64,
}

/// rad/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WheelSpeeds {
    /// omega_R.
    pub right: f64,
    /// omega_L.
    pub left: f64,
}

impl DifferentialDrive {
    /// The `radius` r and the `track` W in metres, the top speed in rad/s; all positive.
    pub fn new(radius: f64, track: f64, top_wheel_speed: f64) -> Self {
        let (half, over) = (radius / 2.0, radius / track);
        Self {
            g: Matrix2::new(half, half, over, -over),
            inverse: Matrix2::new(
                1.0 / radius,
                track / (2.0 * radius),
                1.0 / radius,
                -track / (2.0 * radius),
            ),
            rim_limit: top_wheel_speed,
        }
    }

    /// (2). The map is linear, so wheel angles give (arc, turn).
    pub fn twist(&self, wheels: WheelSpeeds) -> Twist {
        let body = self.g * Vector2::new(wheels.right, wheels.left);
        Twist { v: body.x, omega: body.y }
    }

    /// (17); both are scaled by one factor when a wheel would exceed its limit, so that the curvature stays.
    pub fn wheels(&self, twist: Twist) -> WheelSpeeds {
        let wheels = self.inverse * Vector2::new(twist.v, twist.omega);
        let fastest = wheels.amax();
        let scale = if fastest > self.rim_limit { self.rim_limit / fastest } else { 1.0 };
        WheelSpeeds { right: wheels.x * scale, left: wheels.y * scale }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(got: f64, want: f64) {
        assert!((got - want).abs() < 1e-12, "got {got}, want {want}");
    }

    #[test]
    fn equation_2_by_hand() {
        // r = 0.1, W = 0.4: v = 0.05 (3 + 1) = 0.2, omega = 0.25 (3 - 1) = 0.5.
        let drive = DifferentialDrive::new(0.1, 0.4, 100.0);
        let twist = drive.twist(WheelSpeeds { right: 3.0, left: 1.0 });
        close(twist.v, 0.2);
        close(twist.omega, 0.5);
    }

    #[test]
    fn equation_17_inverts_equation_2() {
        let drive = DifferentialDrive::new(0.1, 0.4, 100.0);
        let wheels = drive.wheels(Twist { v: 0.2, omega: 0.5 });
        close(wheels.right, 3.0);
        close(wheels.left, 1.0);
    }

    #[test]
    fn saturation_keeps_the_curvature() {
        // Unlimited: (3, 1) rad/s; the limit 1.5 halves both.
        let drive = DifferentialDrive::new(0.1, 0.4, 1.5);
        let wheels = drive.wheels(Twist { v: 0.2, omega: 0.5 });
        close(wheels.right, 1.5);
        close(wheels.left, 0.5);
    }
}
