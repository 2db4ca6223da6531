//! Conversion of a reported pose to wheel angles.

use std::f64::consts::TAU;

use glam::DVec2;

use super::{
    Memory, Motion,
    counts::{WheelCounts, wheel_sample},
};
use crate::{
    geometry::wrap_angle,
    kinematics::{Pose2, Twist},
    mission::Body,
    samples::CountsSample,
};

/// Greatest position or heading that odometry can report, metres or radians.
const FARTHEST: f64 = 1e6;
/// Greatest count at which whole numbers are exact.
const MOST_COUNTS: f64 = 9e15;
/// Greatest ratio of rolled distance to that at top speed.
const IMPLAUSIBLE: f64 = 1.5;
const JITTER_S: f64 = 0.1;
/// Greatest error between successive poses, metres.
const SLACK_M: f64 = 0.01;
/// Silence after which a robot may have restarted, seconds. Its pose is then within `NEAR_START` of
/// 0, metres and radians.
const STARTS_IN_S: f64 = 1.0;
const NEAR_START: f64 = 0.05;
/// Current of a blocked wheel, AD counts: the maximum of an X80's converter.
const HELD_AD: u16 = 4095;

/// Wheel angles that reproduce the reported motion.
#[derive(Clone, Copy, Debug, Default)]
pub struct Odometry {
    last: Option<Pose2>,
    turned: [f64; 2],
}

impl Odometry {
    pub fn memory(&self) -> Option<Memory> {
        let Pose2 { position, heading } = self.last?;
        let [left, right] = self.turned;
        Some([position.x, position.y, heading, left, right])
    }

    pub const fn remember(&mut self, [x, y, heading, left, right]: Memory) {
        self.last = Some(Pose2 { position: DVec2::new(x, y), heading });
        self.turned = [left, right];
    }

    /// Without sideways slip; `None` if the numbers are too great.
    pub fn turned(&mut self, pose: [f64; 3], body: &Body) -> Option<[f64; 2]> {
        let now = pose_at(pose)?;
        let [arc, turn, _] = self.way(now);
        self.last = Some(now);
        // (17) is linear, so arc and turn give the wheel angles.
        let [left, right] = body.unlimited().wheels(Twist { v: arc, omega: turn });
        self.turned = [self.turned[0] + left, self.turned[1] + right];
        Some(self.turned)
    }

    /// Returns whether the motion since the newest pose is a jump, which counts as no motion. Jumps
    /// are sideways, longer than this body goes in `gap_s` seconds, or a restart of the odometry.
    pub fn takes_jump(&mut self, pose: [f64; 3], gap_s: f64, body: &Body) -> bool {
        let Some(now) = pose_at(pose) else {
            return false;
        };
        let [arc, turn, aside] = self.way(now);
        let farthest_m = arc.abs() + turn.abs() * body.track_m / 2.0;
        let reach_m = IMPLAUSIBLE * body.top_speed_m_s * (gap_s + JITTER_S) + SLACK_M;
        let starts_again =
            gap_s >= STARTS_IN_S && is_start(now) && self.last.is_some_and(|last| !is_start(last));
        let jumps = farthest_m > reach_m || aside.abs() > reach_m / 2.0 || starts_again;
        if jumps {
            self.last = Some(now);
        }
        jumps
    }

    /// Returns the arc, metres, the turn, radians, and the sideways slip, metres, to `now`; all 0
    /// before the first pose.
    fn way(&self, now: Pose2) -> [f64; 3] {
        let Some(last) = self.last else {
            return [0.0; 3];
        };
        let turn = wrap_angle(now.heading - last.heading);
        let middle = DVec2::from_angle(last.heading + turn / 2.0);
        let went = now.position - last.position;
        let chord = went.dot(middle);
        // The chord of an arc is shorter than the arc.
        let half = turn / 2.0;
        let arc = if half.abs() < 1e-9 { chord } else { chord * half / half.sin() };
        [arc, turn, went.perp_dot(middle)]
    }
}

fn pose_at([x, y, heading]: [f64; 3]) -> Option<Pose2> {
    let position = DVec2::new(x, y);
    let is_near = position.length() <= FARTHEST && heading.abs() <= FARTHEST;
    is_near.then_some(Pose2 { position, heading })
}

fn is_start(pose: Pose2) -> bool {
    pose.position.length() <= NEAR_START && wrap_angle(pose.heading).abs() <= NEAR_START
}

/// Returns the motion of both wheels at these angles and speeds, radians and rad/s; `held` marks
/// blocked wheels.
pub fn motion(body: &Body, turned: [f64; 2], speeds: [f64; 2], held: [bool; 2]) -> Motion {
    let counts = |angle: f64| (angle * body.counts_per_turn / TAU).round();
    let [left_counts, right_counts] =
        turned.map(|angle| counts(angle).clamp(-MOST_COUNTS, MOST_COUNTS));
    Motion {
        wheels: wheel_sample(
            WheelCounts::Endless([left_counts, right_counts]).cyclic(),
            speeds.map(|speed| counts(speed) as i32),
        ),
        endless: Some(CountsSample { left_counts, right_counts, ..CountsSample::default() }),
        stamp_ns: None,
        // A blocked wheel draws its motor's full current.
        currents: held.map(|held| if held { HELD_AD } else { 0 }),
    }
}

/// Takes counts/s.
pub fn twist(body: &Body, counts: [i16; 2]) -> Twist {
    body.unlimited().twist(wheel_speeds(body, counts))
}

pub fn wheel_speeds(body: &Body, counts: [i16; 2]) -> [f64; 2] {
    counts.map(|counts| f64::from(counts) * TAU / body.counts_per_turn)
}
