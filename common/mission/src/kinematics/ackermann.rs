//! Car-like robot (3) and its inverse (17).

use super::pose::Twist;

/// G of (3): one driven axle and one steered axle; all sizes are positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ackermann {
    /// r, metres.
    pub wheel_radius: f64,
    /// L, driven to steered axle, metres.
    pub wheelbase: f64,
    /// Radians, below pi/2.
    pub steering_limit: f64,
    /// In rad/s.
    pub top_wheel_speed: f64,
    /// Limit of turns commanded without enough speed, m/s.
    pub creep: f64,
}

impl Ackermann {
    /// Returns the radius of the driven axle's midpoint, metres.
    pub fn least_turning_radius(&self) -> f64 {
        self.wheelbase / self.steering_limit.tan()
    }

    /// Maps omega_h, rad/s, and phi, radians, positive to the left, by (3).
    pub fn twist(&self, [wheel, steering]: [f64; 2]) -> Twist {
        let v = self.wheel_radius * wheel;
        Twist { v, omega: steering.tan() / self.wheelbase * v }
    }

    /// Inverts the map by (17): omega_h = v/r, phi = atan(L omega / v), clipped.
    ///
    /// A car creeps forward if v makes the turn impossible. A saturated wheel keeps the steering,
    /// and so the curvature.
    pub fn wheel(&self, twist: Twist) -> [f64; 2] {
        let needed = twist.omega.abs() * self.least_turning_radius();
        let v = if twist.v.abs() < needed {
            let direction = if twist.v < 0.0 { -1.0 } else { 1.0 };
            direction * twist.v.abs().max(needed.min(self.creep))
        } else {
            twist.v
        };
        let steering = if v == 0.0 { 0.0 } else { (self.wheelbase * twist.omega / v).atan() };
        let top = self.top_wheel_speed;
        [
            (v / self.wheel_radius).clamp(-top, top),
            steering.clamp(-self.steering_limit, self.steering_limit),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::close;
    use std::f64::consts::FRAC_PI_4;

    fn car(steering_limit: f64) -> Ackermann {
        Ackermann {
            wheel_radius: 0.1,
            wheelbase: 0.5,
            steering_limit,
            top_wheel_speed: 10.0,
            creep: 0.05,
        }
    }

    fn twists() -> impl Iterator<Item = Twist> {
        let speeds = (-30..=30).map(|v| f64::from(v) * 0.05);
        speeds.flat_map(|v| {
            let turns = (-30..=30).map(|omega| f64::from(omega) * 0.1);
            turns.map(move |omega| Twist { v, omega })
        })
    }

    #[test]
    fn equation_3_by_hand_and_back() {
        // Wheels of 0.1 m, 0.5 m between the axles: at 45 degrees and 4 rad/s v = 0.4, omega = 0.4
        // / 0.5 = 0.8.
        let twist = car(1.0).twist([4.0, FRAC_PI_4]);
        close(twist.v, 0.4);
        close(twist.omega, 0.8);
        let [wheel, steering] = car(1.0).wheel(twist);
        close(wheel, 4.0);
        close(steering, FRAC_PI_4);
    }

    #[test]
    fn limits_by_hand() {
        // At 45 degrees the least radius is the wheelbase.
        close(car(FRAC_PI_4).least_turning_radius(), 0.5);
        // A car asked to turn at rest creeps forward at full steering.
        let [wheel, steering] = car(0.5).wheel(Twist { v: 0.0, omega: -1.0 });
        close(wheel, 0.5);
        close(steering, -0.5);
        assert_eq!(car(0.5).wheel(Twist::default()), [0.0; 2]);
        // The command needs 20 rad/s and the limit is 10, so both are halved.
        let twist = car(1.0).twist(car(1.0).wheel(Twist { v: 2.0, omega: 0.8 }));
        close(twist.v, 1.0);
        close(twist.omega, 0.4);
    }

    #[test]
    fn what_the_inverse_asks_for_is_within_the_limits_and_to_the_side_that_was_asked_for() {
        for twist in twists() {
            let [wheel, steering] = car(0.5).wheel(twist);
            assert!(wheel.abs() <= 10.0 && steering.abs() <= 0.5, "{twist:?}: {wheel} {steering}");
            let got = car(0.5).twist([wheel, steering]);
            let turns = twist.v >= 0.0 && twist.omega != 0.0;
            assert!(!turns || got.omega * twist.omega > 0.0 && got.v > 0.0, "{twist:?}: {got:?}");
        }
    }

    #[test]
    fn the_inverse_is_exact_wherever_the_twist_is_feasible() {
        let car = car(0.5);
        let mut feasible = 0;
        for twist in twists() {
            let slow = twist.v.abs() <= 1.0;
            if slow && twist.v.abs() > twist.omega.abs() * car.least_turning_radius() {
                let back = car.twist(car.wheel(twist));
                close(back.v, twist.v);
                close(back.omega, twist.omega);
                feasible += 1;
            }
        }
        assert!(feasible > 100, "{feasible}");
    }
}
