//! Differential drive (2) and its inverse (17).

use super::pose::Twist;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferentialDrive {
    radius: f64,
    track: f64,
    top_wheel_speed: f64,
}

impl DifferentialDrive {
    /// Takes the `radius` r and the `track` W in metres, and the top speed in rad/s; all positive.
    pub fn new(radius: f64, track: f64, top_wheel_speed: f64) -> Self {
        Self { radius, track, top_wheel_speed }
    }

    /// Maps omega_L and omega_R, rad/s, by (2). The map is linear, so wheel angles give (arc,
    /// turn).
    pub fn twist(&self, [left, right]: [f64; 2]) -> Twist {
        let (half, over) = (self.radius / 2.0, self.radius / self.track);
        Twist { v: half * right + half * left, omega: over * right - over * left }
    }

    /// Inverts the map by (17) to omega_L and omega_R, rad/s. If a wheel would exceed its limit,
    /// one factor scales both, which keeps the curvature.
    pub fn wheels(&self, twist: Twist) -> [f64; 2] {
        let (rim, turn) =
            (1.0 / self.radius * twist.v, self.track / (2.0 * self.radius) * twist.omega);
        let (right, left) = (rim + turn, rim - turn);
        let fastest = right.abs().max(left.abs());
        let scale =
            if fastest > self.top_wheel_speed { self.top_wheel_speed / fastest } else { 1.0 };
        [left * scale, right * scale]
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
        let twist = drive.twist([1.0, 3.0]);
        close(twist.v, 0.2);
        close(twist.omega, 0.5);
    }

    #[test]
    fn equation_17_inverts_equation_2() {
        let drive = DifferentialDrive::new(0.1, 0.4, 100.0);
        let [left, right] = drive.wheels(Twist { v: 0.2, omega: 0.5 });
        close(right, 3.0);
        close(left, 1.0);
    }

    #[test]
    fn saturation_keeps_the_curvature() {
        // Unlimited: (3, 1) rad/s; the limit 1.5 halves both.
        let drive = DifferentialDrive::new(0.1, 0.4, 1.5);
        let [left, right] = drive.wheels(Twist { v: 0.2, omega: 0.5 });
        close(right, 1.5);
        close(left, 0.5);
    }
}
