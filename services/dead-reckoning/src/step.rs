//! The step from counts to pose, for two wheels, (20), or for a car's driven wheel and steering, (3). The pose is an integral that
//! nothing can recompute, so its state is in the checkpoint.

use common::{
    clock::MissionTime,
    kinematics::{Drive, Pose2, SteeredWheel, Twist, WheelSpeeds},
    mission::{Body, Integration, Mission},
    samples::{PoseSample, WheelSample},
    step::{ForeignState, Step},
    wire::{counts_between, counts_restarted},
};
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::covariance::{Covariance, ErrorModel};

/// Counts are rejected if a wheel seems to turn faster than this multiple of its top speed. A robot that slides or is pushed stays
/// below it; a counter that restarted is nearly always above it.
const PLAUSIBLE: f64 = 2.0;
/// Counts never rejected, whatever the time between: timestamps jitter by about a tick.
const SLACK_S: f64 = 0.3;

/// A speed is an average over at least this share of a tick: frames that come bunched give no speed of their own.
const LEAST_SHARE_OF_A_TICK: f64 = 0.5;

/// A wheel still turns for so long after the time of its last command is over, seconds: delay and lag of its speed loop.
const COASTS_S: f64 = 0.2;

/// No robot is switched off and on again and answers sooner, seconds; a link that was killed is back in a tenth.
const BOOTS_IN_S: f64 = 2.0;

/// The state that survives the process: the pose, and the counts it was computed at.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    position: DVec2,
    heading: f64,
    travelled: f64,
    covariance: Covariance,
    last: Option<Last>,
}

impl State {
    /// Tick and mission time of the newest wheel sample in it; none before the first.
    pub fn newest(&self) -> Option<(u64, MissionTime)> {
        self.last.map(|last| (last.tick, last.time))
    }
}

/// The wheel sample the pose was computed from, and the speeds it gave.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Last {
    tick: u64,
    time: MissionTime,
    left: u16,
    right: u16,
    /// The generation of the link that gave it, and the robot's restarts it knew of.
    generation: u32,
    restarts: u32,
    v: f64,
    omega: f64,
}

/// The result of one wheel sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reckoned {
    pub pose: PoseSample,
    /// The counts jumped farther than wheels can turn, or the robot restarted its counters: the pose stays, and its covariance grows
    /// by how far the robot can have gone.
    pub rejected: bool,
}

/// The integrator of (20) and (21).
#[derive(Clone, Debug)]
pub struct DeadReckoning {
    drive: Drive,
    body: Body,
    integration: Integration,
    errors: ErrorModel,
    /// The period of the ticks, seconds.
    period_s: f64,
    /// The longest that wheels turn after a tick that no further one follows, seconds.
    turns_on_s: f64,
    state: State,
}

impl Step for DeadReckoning {
    type Input<'a> = &'a WheelSample;
    type Output = Reckoned;
    type State = State;

    fn new(mission: &Mission) -> Self {
        let body = mission.body();
        let start = mission.start_pose();
        let errors = ErrorModel::new(&mission.robot.odometry, &body);
        let period_s = 1.0 / mission.robot.rate_hz;
        Self {
            drive: body.drive(),
            body,
            integration: mission.dead_reckoning.integration,
            errors,
            period_s,
            turns_on_s: period_s + mission.robot.command_limit_s + COASTS_S,
            state: State {
                position: start.position,
                heading: start.heading,
                travelled: 0.0,
                covariance: errors.start(),
                last: None,
            },
        }
    }

    fn state(&self) -> &State {
        &self.state
    }

    fn restore(&mut self, state: State) -> Result<(), ForeignState> {
        self.state = state;
        Ok(())
    }

    /// Integrate up to one wheel sample. A tick given twice gives the same pose twice.
    fn step(&mut self, wheels: &WheelSample, now: MissionTime) -> Reckoned {
        let (left, right) = (wheels.left_counts, wheels.right_counts);
        let (mut v, mut omega) = (0.0, 0.0);
        let mut rejected = false;
        if let Some(last) = self.state.last {
            if last.tick == wheels.stamp.tick {
                return Reckoned { pose: self.sample(), rejected };
            }
            let elapsed = now.since(last.time).as_secs_f64();
            let moved = self.moved(last, wheels, elapsed);
            rejected = moved.is_none();
            let motion = moved.unwrap_or_default();
            let pose = Pose2 { position: self.state.position, heading: self.state.heading };
            let moved = match self.integration {
                Integration::Arc => pose.along_arc(motion.v, motion.omega),
                Integration::Euler => pose.along_euler(motion.v, motion.omega),
            };
            self.state.covariance = self.errors.after(&self.state.covariance, pose, motion);
            if rejected {
                // A robot without ticks gets no commands, so its wheels soon rest.
                let lost_m = self.body.top_speed_m_s * elapsed.min(self.turns_on_s);
                self.state.covariance = self.errors.after_lost(&self.state.covariance, lost_m);
            }
            self.state.position = moved.position;
            self.state.heading = moved.heading;
            self.state.travelled += motion.v.abs();
            (v, omega) = self.speeds(motion, elapsed);
        }
        self.state.last = Some(Last {
            tick: wheels.stamp.tick,
            time: now,
            left,
            right,
            generation: wheels.stamp.generation,
            restarts: wheels.restarts,
            v,
            omega,
        });
        Reckoned { pose: self.sample(), rejected }
    }
}

impl DeadReckoning {
    /// Arc and turn since `last`, metres and radians; none if the counts cannot have come from turning wheels.
    fn moved(&self, last: Last, wheels: &WheelSample, elapsed: f64) -> Option<Twist> {
        let (left, right) = (
            counts_between(last.left, wheels.left_counts),
            counts_between(last.right, wheels.right_counts),
        );
        let per_count = std::f64::consts::TAU / self.body.counts_per_turn;
        let top = self.body.top_speed_m_s / self.body.metres_per_count();
        let limit = top * PLAUSIBLE * (elapsed + SLACK_S);
        if f64::from(left.abs().max(right.abs())) > limit || restarted(last, wheels, elapsed) {
            return None;
        }
        // (20) is linear in the wheels: their angles give arc and turn as their speeds give v and omega.
        let wheel = f64::from(left) * per_count;
        Some(match &self.drive {
            Drive::Differential(drive) => {
                drive.twist(WheelSpeeds { left: wheel, right: f64::from(right) * per_count })
            }
            Drive::Ackermann(drive) => {
                // The mean of the two angles is taken as the steering on the way.
                let middle = f64::from(counts_between(0, last.right)) + f64::from(right) / 2.0;
                let angle = self.body.steering.map(|steering| steering.angle(middle));
                drive.twist(SteeredWheel { wheel, steering: angle.unwrap_or_default() })
            }
        })
    }

    /// Speed and turn rate of a motion, m/s and rad/s: no faster than the body can go, along the same curve.
    fn speeds(&self, moved: Twist, elapsed: f64) -> (f64, f64) {
        let time = elapsed.max(LEAST_SHARE_OF_A_TICK * self.period_s);
        let (v, omega) = (moved.v / time, moved.omega / time);
        let wheel = match self.body.steering {
            Some(_) => v.abs(),
            None => v.abs() + omega.abs() * self.body.track_m / 2.0,
        };
        let share = (self.body.top_speed_m_s / wheel).min(1.0);
        (v * share, omega * share)
    }

    fn sample(&self) -> PoseSample {
        let State { position, heading, travelled, covariance, last } = self.state;
        let (left_counts, right_counts, v, omega) =
            last.map_or((0, 0, 0.0, 0.0), |last| (last.left, last.right, last.v, last.omega));
        PoseSample {
            x_m: position.x,
            y_m: position.y,
            heading_rad: heading,
            v_m_s: v,
            omega_rad_s: omega,
            travelled_m: travelled,
            covariance: covariance.of_pose(),
            left_counts,
            right_counts,
            ..PoseSample::default()
        }
    }
}

/// Whether the robot restarted its counts after `last`. The link sees that in the frames between; only
/// what happened between two generations of it must be read off the counts themselves.
fn restarted(last: Last, wheels: &WheelSample, elapsed: f64) -> bool {
    if last.generation == wheels.stamp.generation {
        return last.restarts != wheels.restarts;
    }
    // A robot that turns back through its start while the link is killed looks the same, but for the time.
    elapsed >= BOOTS_IN_S
        && counts_restarted([last.left, last.right], [wheels.left_counts, wheels.right_counts])
}

#[cfg(test)]
mod tests;
