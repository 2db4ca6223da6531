//! Predicts the pose at which a command will act, for planner and controller.
//!
//! A late base overshoots in turn and distance if commands are computed for the observed pose. Its
//! response predicts the effect of pending commands. A prompt base uses the observed pose: a Jackal
//! was a sixth slower with the lead.

use std::collections::VecDeque;

use crate::{
    Base, Mission,
    geometry::wrap_angle,
    kinematics::{DifferentialDrive, Drive, Pose2, TURN_GAIN, Twist},
};

/// Product of gain and dead time up to which a proportional law is well damped; from pi / 2 on it
/// oscillates without end.
const DAMPED: f64 = 0.5;
const STEP_S: f64 = 0.02;

/// Longest time that is integrated in steps, seconds.
const LONGEST_S: f64 = 60.0;
/// Limit of the pending commands; beyond it the oldest acts at once.
const MOST_PENDING: usize = 256;

#[derive(Clone, Debug)]
pub struct Lead {
    drive: DifferentialDrive,
    base: Base,
    pub(crate) dead_time_s: f64,
    /// With their times of effect.
    pending: VecDeque<(f64, Twist)>,
    wanted: Twist,
    twist: Twist,
    at_s: f64,
    /// First pose and its time, until the second gives the initial motion.
    first: Option<(Pose2, f64)>,
    /// Whether the robot's motion is known.
    has_begun: bool,
}

impl Lead {
    /// Returns `None` for a car and for a base that answers soon enough.
    pub fn new(mission: &Mission) -> Option<Self> {
        let body = mission.body();
        let dead_time_s = body.response.dead_time_s();
        let Drive::Differential(drive) = body.drive() else {
            return None;
        };
        (dead_time_s * TURN_GAIN > DAMPED).then(|| Self {
            drive,
            base: Base::new(body.response, body.track_m),
            dead_time_s,
            pending: VecDeque::new(),
            wanted: Twist::default(),
            twist: Twist::default(),
            at_s: f64::NEG_INFINITY,
            first: None,
            has_begun: false,
        })
    }

    /// Where a command given now acts; `pose` belongs to `now_s`.
    pub fn foresee(&mut self, pose: Pose2, now_s: f64) -> (Pose2, Twist) {
        self.go_on(pose, now_s);
        self.begin(pose, now_s);
        let mut ahead = self.clone();
        (ahead.go_on(pose, now_s + self.dead_time_s), ahead.twist)
    }

    /// Estimates the initial motion, because the robot may be moving when the model begins.
    fn begin(&mut self, pose: Pose2, now_s: f64) {
        let Some((first, first_s)) = self.first else {
            self.first = Some((pose, now_s));
            return;
        };
        let for_s = now_s - first_s;
        if !self.has_begun && for_s > 0.0 {
            self.has_begun = true;
            let v = (pose.position - first.position).dot(pose.axis()) / for_s;
            let omega = wrap_angle(pose.heading - first.heading) / for_s;
            self.twist = self.drive.twist(self.drive.wheels(Twist { v, omega }));
            self.wanted = self.twist;
        }
    }

    /// Records the command `twist` for a pose at `now_s`, with its curve limited to the wheels' top
    /// speed.
    pub fn command(&mut self, twist: Twist, now_s: f64) {
        let twist = self.drive.twist(self.drive.wheels(twist));
        if self.pending.len() == MOST_PENDING
            && let Some((_, oldest)) = self.pending.pop_front()
        {
            self.wanted = oldest;
        }
        self.pending.push_back((now_s + self.dead_time_s, twist));
        assert!(self.pending.len() <= MOST_PENDING);
    }

    fn go_on(&mut self, mut pose: Pose2, until_s: f64) -> Pose2 {
        // Before the first call no time has passed.
        self.at_s = if self.at_s.is_finite() { self.at_s } else { until_s };
        if until_s - self.at_s > LONGEST_S {
            // The newest command has taken effect by now. Samples may carry any time.
            self.twist =
                self.pending.drain(..).next_back().map_or(self.wanted, |(_, newest)| newest);
            self.wanted = self.twist;
            self.has_begun = true;
            self.at_s = until_s;
        }
        while self.at_s < until_s || self.pending.front().is_some_and(|next| next.0 <= until_s) {
            let acts_s = self.pending.front().map_or(f64::INFINITY, |next| next.0);
            let to_s = (self.at_s + STEP_S).min(until_s).min(acts_s).max(self.at_s);
            let for_s = to_s - self.at_s;
            let before = self.twist;
            self.twist = self.base.approach(before, self.wanted, for_s);
            let [v, omega] =
                [[before.v, self.twist.v], [before.omega, self.twist.omega]].map(|[from, to]| {
                    if self.base.is_limited() { f64::midpoint(from, to) } else { to }
                });
            pose = pose.along_arc(v * for_s, omega * for_s);
            self.at_s = to_s;
            if acts_s <= to_s
                && let Some((_, wanted)) = self.pending.pop_front()
            {
                self.wanted = wanted;
                self.has_begun = true;
            }
        }
        pose
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::mission;

    fn lead(text: &str) -> Option<Lead> {
        let speeds = "controller.speed_m_s = 0.5\nrobot.top_speed_m_s = 0.5";
        Lead::new(&mission(&format!("{speeds}\n{text}")))
    }

    fn late() -> Lead {
        lead("robot.response = { delay_s = 0.4, lag_s = 0.1 }").unwrap()
    }

    #[test]
    fn a_late_base_is_foreseen_on_the_curve_of_the_commands_that_it_has_not_answered_yet() {
        assert!(lead("").is_none());
        let mut lead = late();
        let at = |lead: &mut Lead, now_s| lead.foresee(Pose2::default(), now_s).0;
        assert_eq!(at(&mut lead, 0.0), Pose2::default());
        lead.command(Twist { v: 0.2, omega: 0.5 }, 0.0);
        lead.command(Twist { v: 0.0, omega: 0.0 }, 0.4);
        let pose = at(&mut lead, 0.5);
        let close = |got: f64, want: f64| assert!((got - want).abs() < 1e-9, "{got} {want}");
        close(pose.heading, 0.2);
        close(pose.position.x, 0.4 * 0.2_f64.sin());
        // Saturated wheels keep the curve.
        lead.command(Twist { v: 1.0, omega: 1.0 }, 1.0);
        let Pose2 { position, heading } = at(&mut lead, 1.5);
        assert!(heading > 0.1 && position.length() < 0.26, "{position} {heading}");
        close(position.x, heading.sin());
    }

    #[test]
    fn a_robot_that_is_on_its_way_when_the_model_begins_goes_on() {
        let mut lead = late();
        let at = |x| Pose2 { position: glam::DVec2::new(x, 0.0), heading: 0.0 };
        lead.foresee(at(0.0), 1.0);
        let (pose, twist) = lead.foresee(at(0.03), 1.1);
        assert!((twist.v - 0.3).abs() < 1e-9 && (pose.position.x - 0.18).abs() < 1e-9, "{pose:?}");
    }

    #[test]
    fn a_time_that_is_ages_ahead_is_not_followed_step_by_step() {
        let mut lead = late();
        lead.foresee(Pose2::default(), 0.0);
        lead.command(Twist { v: 0.2, omega: 0.0 }, 0.0);
        let (pose, twist) = lead.foresee(Pose2::default(), 1.8e10);
        assert!((twist.v - 0.2).abs() < 1e-9 && (pose.position.x - 0.1).abs() < 1e-4, "{pose:?}");
    }
}
