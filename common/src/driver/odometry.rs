//! The way of a robot as angles of its wheels, for drivers of robots that say their pose.

use std::f64::consts::TAU;

use glam::DVec2;

use super::{Memory, Motion};
use crate::{
    geometry::wrap_angle,
    kinematics::{DifferentialDrive, Pose2, Twist, WheelSpeeds},
    mission::Body,
    samples::WheelSample,
    wire::COUNT_CYCLE,
};

/// No odometry says that a robot is farther away, metres, or has turned farther, radians.
const FARTHEST: f64 = 1e6;
/// The current of a wheel that is held: all that the converter of an X80 can say, AD counts.
const HELD_AD: u16 = 4095;

/// The angles by which wheels would have turned on the way of a robot that says its pose.
#[derive(Clone, Copy, Debug, Default)]
pub struct Odometry {
    last: Option<Pose2>,
    turned: [f64; 2],
}

impl Odometry {
    /// The newest pose and the angles of the wheels there; none before the first.
    pub fn memory(&self) -> Option<Memory> {
        let Pose2 { position, heading } = self.last?;
        let [left, right] = self.turned;
        Some([position.x, position.y, heading, left, right])
    }

    /// Go on from there.
    pub const fn remember(&mut self, [x, y, heading, left, right]: Memory) {
        self.last = Some(Pose2 { position: DVec2::new(x, y), heading });
        self.turned = [left, right];
    }

    /// The angles of the left and the right wheel of a robot that is at `x`, `y` with this heading by its odometry. What it slipped aside is
    /// left out, as wheels leave it out. None if the numbers are too great to be a way.
    pub fn turned(&mut self, [x, y, heading]: [f64; 3], body: &Body) -> Option<[f64; 2]> {
        let now = Pose2 { position: DVec2::new(x, y), heading };
        let is_near = now.position.length() <= FARTHEST && heading.abs() <= FARTHEST;
        if !is_near {
            return None;
        }
        let Some(last) = self.last.replace(now) else {
            return Some(self.turned);
        };
        let turn = wrap_angle(now.heading - last.heading);
        let middle = DVec2::from_angle(last.heading + turn / 2.0);
        let chord = (now.position - last.position).dot(middle);
        // The chord of an arc is shorter than the arc by this.
        let half = turn / 2.0;
        let arc = if half.abs() < 1e-9 { chord } else { chord * half / half.sin() };
        // (17) is linear: an arc and a turn give the angles of the wheels.
        let WheelSpeeds { right, left } = drive(body).wheels(Twist { v: arc, omega: turn });
        self.turned = [self.turned[0] + left, self.turned[1] + right];
        Some(self.turned)
    }
}

/// The drive of a body whose wheels have no limit.
#[must_use]
pub fn drive(body: &Body) -> DifferentialDrive {
    DifferentialDrive::new(body.wheel_radius_m, body.track_m, f64::INFINITY)
}

/// The motion of a robot whose left and right wheel have turned by these angles and turn at these speeds, radians and rad/s; `held` says
/// whether something holds each.
#[must_use]
pub fn motion(body: &Body, turned: [f64; 2], speeds: [f64; 2], held: [bool; 2]) -> Motion {
    let counts = |angle: f64| angle * body.counts_per_turn / TAU;
    let [left_counts, right_counts] =
        turned.map(|angle| counts(angle).round().rem_euclid(f64::from(COUNT_CYCLE)) as u16);
    let [left_counts_per_s, right_counts_per_s] = speeds.map(|speed| counts(speed).round() as i32);
    Motion {
        wheels: WheelSample {
            left_counts,
            right_counts,
            left_counts_per_s,
            right_counts_per_s,
            ..WheelSample::default()
        },
        // A wheel that is held draws all that its motor can.
        currents: held.map(|held| if held { HELD_AD } else { 0 }),
    }
}

/// The speed ahead, m/s, and the turn rate, rad/s, of a body whose left and right wheel turn at these speeds, counts/s.
#[must_use]
pub fn twist(body: &Body, counts: [i16; 2]) -> Twist {
    let [left, right] = wheel_speeds(body, counts);
    drive(body).twist(WheelSpeeds { right, left })
}

/// The speeds of the left and the right wheel, rad/s, that are these counts/s.
#[must_use]
pub fn wheel_speeds(body: &Body, counts: [i16; 2]) -> [f64; 2] {
    counts.map(|counts| f64::from(counts) * TAU / body.counts_per_turn)
}
