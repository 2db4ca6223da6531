//! Differential drive (2) and its inverse (17).

use super::pose::Twist;

/// G of (2): two driven wheels; all sizes are positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferentialDrive {
    /// r, metres.
    pub radius: f64,
    /// W, metres.
    pub track: f64,
    /// In rad/s.
    pub top_wheel_speed: f64,
}

impl DifferentialDrive {
    /// Maps omega_L and omega_R, rad/s, by (2). The map is linear, so wheel angles give (arc,
    /// turn).
    pub fn twist(&self, [left, right]: [f64; 2]) -> Twist {
        let half = self.radius / 2.0;
        let over = self.radius / self.track;
        Twist { v: half * right + half * left, omega: over * right - over * left }
    }

    /// Inverts the map by (17) to omega_L and omega_R, rad/s. If a wheel would exceed its limit,
    /// one factor scales both, which keeps the curvature.
    pub fn wheels(&self, twist: Twist) -> [f64; 2] {
        let rim = 1.0 / self.radius * twist.v;
        let turn = self.track / (2.0 * self.radius) * twist.omega;
        let right = rim + turn;
        let left = rim - turn;
        let fastest = right.abs().max(left.abs());
        let scale =
            if fastest > self.top_wheel_speed { self.top_wheel_speed / fastest } else { 1.0 };
        [left * scale, right * scale]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::close;

    #[test]
    fn equation_2_by_hand_and_its_inverse_which_keeps_the_curvature_at_the_wheels_limit() {
        // r = 0.1, W = 0.4: v = 0.05 (3 + 1) = 0.2, omega = 0.25 (3 - 1) = 0.5.
        for (limit, wheels) in [(100.0, [1.0, 3.0]), (1.5, [0.5, 1.5])] {
            let drive = DifferentialDrive { radius: 0.1, track: 0.4, top_wheel_speed: limit };
            let Twist { v, omega } = drive.twist([1.0, 3.0]);
            close(v, 0.2);
            close(omega, 0.5);
            let got = drive.wheels(Twist { v, omega });
            (0..2).for_each(|wheel| close(got[wheel], wheels[wheel]));
        }
    }
}
