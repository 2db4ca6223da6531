//! The rigid motion of the robot, (1), and the two maps G between wheels and body, (2), (3), with
//! their inverses, (17).

use glam::DVec2;
use nalgebra::{Matrix2, Rotation2, Vector2};
use serde::{Deserialize, Serialize};

/// Where the robot's centre is and which way it faces, in the mission frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose2 {
    /// Metres.
    pub position: DVec2,
    /// theta, radians counter-clockwise from x.
    pub heading: f64,
}

/// v and omega of (1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// v: tangential speed, m/s.
    pub v: f64,
    /// omega: turn rate, rad/s.
    pub omega: f64,
}

impl Pose2 {
    /// The unit vector ahead.
    #[must_use]
    pub fn axis(&self) -> DVec2 {
        DVec2::from_angle(self.heading)
    }

    /// The pose after `arc` metres along a circle while turning by `turn` radians: (1) integrated
    /// exactly for constant v and omega.
    #[must_use]
    pub fn along_arc(&self, arc: f64, turn: f64) -> Self {
        // sin(h)/h, stable through h = 0: the chord of the arc over its length.
        let half = turn / 2.0;
        let chord = if half.abs() < 1e-6 {
            1.0 - half * half / 6.0
        } else {
            half.sin() / half
        };
        let step = Rotation2::new(self.heading + half) * Vector2::new(arc * chord, 0.0);
        Self {
            position: self.position + DVec2::new(step.x, step.y),
            heading: self.heading + turn,
        }
    }

    /// One forward Euler step of (21): along the heading held before the turn.
    #[must_use]
    pub fn along_euler(&self, arc: f64, turn: f64) -> Self {
        let step = Rotation2::new(self.heading) * Vector2::new(arc, 0.0);
        Self {
            position: self.position + DVec2::new(step.x, step.y),
            heading: self.heading + turn,
        }
    }
}

/// G of (2): a differential drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferentialDrive {
    g: Matrix2<f64>,
    inverse: Matrix2<f64>,
    rim_limit: f64,
}

/// Wheel speeds, rad/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WheelSpeeds {
    /// omega_R.
    pub right: f64,
    /// omega_L.
    pub left: f64,
}

impl DifferentialDrive {
    /// The drive of a robot with wheels of `radius` r and a `track` W (metres), whose wheels turn at
    /// most at `top_wheel_speed` rad/s. All positive.
    #[must_use]
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

    /// (2): wheel speeds to the body's twist. It is linear, so wheel angles give (arc, turn) likewise.
    #[must_use]
    pub fn twist(&self, wheels: WheelSpeeds) -> Twist {
        let body = self.g * Vector2::new(wheels.right, wheels.left);
        Twist {
            v: body.x,
            omega: body.y,
        }
    }

    /// (17): the wheel speeds that give `twist`; both scaled by one factor when a wheel would exceed
    /// its limit, so that the curvature stays.
    #[must_use]
    pub fn wheels(&self, twist: Twist) -> WheelSpeeds {
        let wheels = self.inverse * Vector2::new(twist.v, twist.omega);
        let fastest = wheels.amax();
        let scale = if fastest > self.rim_limit {
            self.rim_limit / fastest
        } else {
            1.0
        };
        WheelSpeeds {
            right: wheels.x * scale,
            left: wheels.y * scale,
        }
    }
}

/// G of (3): a car-like robot, driven by one wheel and steered by another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CarLike {
    /// r: radius of the driving wheel, metres.
    pub wheel_radius_m: f64,
    /// L: from the driving axle to the steering wheel, metres.
    pub wheelbase_m: f64,
    /// The most |phi| the steering can do, radians, below pi/2.
    pub steering_limit: f64,
    /// Speed kept when a turn is asked for at rest: a car cannot turn on the spot, m/s.
    pub creep_m_s: f64,
}

/// U of a car-like robot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CarControl {
    /// omega_h: driving wheel speed, rad/s.
    pub wheel: f64,
    /// phi: steering angle, radians.
    pub steering: f64,
}

impl CarLike {
    /// (3): control to twist.
    #[must_use]
    pub fn twist(&self, control: CarControl) -> Twist {
        let v = self.wheel_radius_m * control.wheel;
        Twist {
            v,
            omega: control.steering.tan() / self.wheelbase_m * v,
        }
    }

    /// The inverse of (3): omega_h = v/r, phi = atan(L omega / v), clipped; creeps forward when v would
    /// leave a needed turn impossible.
    #[must_use]
    pub fn control(&self, twist: Twist) -> CarControl {
        let needed = twist.omega.abs() * self.wheelbase_m / self.steering_limit.tan();
        let v = if twist.v.abs() < needed {
            let direction = if twist.v < 0.0 { -1.0 } else { 1.0 };
            direction * twist.v.abs().max(needed.min(self.creep_m_s))
        } else {
            twist.v
        };
        let steering = if v == 0.0 {
            0.0
        } else {
            (self.wheelbase_m * twist.omega / v)
                .atan()
                .clamp(-self.steering_limit, self.steering_limit)
        };
        CarControl {
            wheel: v / self.wheel_radius_m,
            steering,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    fn close(got: f64, want: f64) {
        assert!((got - want).abs() < 1e-12, "got {got}, want {want}");
    }

    #[test]
    fn equation_2_by_hand() {
        // r = 0.1, W = 0.4: v = 0.05 (3 + 1) = 0.2, omega = 0.25 (3 - 1) = 0.5.
        let drive = DifferentialDrive::new(0.1, 0.4, 100.0);
        let twist = drive.twist(WheelSpeeds {
            right: 3.0,
            left: 1.0,
        });
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

    #[test]
    fn equation_3_by_hand_and_back() {
        // r = 0.1, L = 0.5, phi = 45 degrees, 4 rad/s: v = 0.4, omega = 0.4 / 0.5 = 0.8.
        let car = CarLike {
            wheel_radius_m: 0.1,
            wheelbase_m: 0.5,
            steering_limit: 1.0,
            creep_m_s: 0.05,
        };
        let control = CarControl {
            wheel: 4.0,
            steering: FRAC_PI_4,
        };
        let twist = car.twist(control);
        close(twist.v, 0.4);
        close(twist.omega, 0.8);
        let back = car.control(twist);
        close(back.wheel, 4.0);
        close(back.steering, FRAC_PI_4);
    }

    #[test]
    fn a_car_asked_to_turn_at_rest_creeps_forward_at_full_steering() {
        let car = CarLike {
            wheel_radius_m: 0.1,
            wheelbase_m: 0.5,
            steering_limit: 0.5,
            creep_m_s: 0.05,
        };
        let control = car.control(Twist {
            v: 0.0,
            omega: -1.0,
        });
        close(control.wheel, 0.5);
        close(control.steering, -0.5);
        assert_eq!(car.control(Twist::default()), CarControl::default());
    }

    #[test]
    fn the_arc_of_a_quarter_circle_by_hand() {
        // Radius 2, from the origin facing x: ends at (2, 2) facing y.
        let end = Pose2::default().along_arc(FRAC_PI_2 * 2.0, FRAC_PI_2);
        close(end.position.x, 2.0);
        close(end.position.y, 2.0);
        close(end.heading, FRAC_PI_2);
    }

    #[test]
    fn equation_21_moves_along_the_old_heading() {
        let end = Pose2 {
            heading: FRAC_PI_2,
            ..Pose2::default()
        }
        .along_euler(0.3, 0.2);
        close(end.position.x, 0.0);
        close(end.position.y, 0.3);
        close(end.heading, FRAC_PI_2 + 0.2);
    }
}
