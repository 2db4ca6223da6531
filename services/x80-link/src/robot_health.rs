//! What the robot's frames say of the robot, held against what it was told: is it believed, does it obey, does what is
//! needed come.
//!
//! in lockstep the robot is a simulated one, and no time passes by which to judge: it is believed.

use std::time::Duration;

use common::{
    clock::{MissionTime, Pace},
    mission::Mission,
    samples::Cause,
    wire::COUNT_CYCLE,
};

use crate::{
    failsafe,
    latency_monitor::LatencyMonitor,
    odometry::Odometry,
    restart::{Counts, RestartWatch},
    stop_monitor::{StopMethod, StopMonitor},
    streams::{Motor, Streams},
};

/// A robot that does not obey is told to stand by other means after so long.
const NEXT_METHOD_AFTER: Duration = Duration::from_millis(300);

/// The senses of one robot.
#[derive(Clone, Debug)]
pub struct RobotHealth {
    restart: RestartWatch,
    odometry: Odometry,
    stop_monitor: StopMonitor,
    streams: Streams,
    latency_monitor: LatencyMonitor,
    limit: Duration,
    sonar_index: u8,
    tried: Option<MissionTime>,
}

impl RobotHealth {
    /// Of the robot of `mission`, of which nothing is known.
    #[must_use]
    pub fn new(mission: &Mission) -> Self {
        Self {
            restart: RestartWatch::new(mission),
            odometry: Odometry::new(mission),
            stop_monitor: StopMonitor::new(mission),
            streams: Streams::new(mission),
            latency_monitor: LatencyMonitor::new(mission),
            limit: Duration::from_secs_f64(mission.robot.command_limit_s),
            sonar_index: mission.sonar.index,
            tried: None,
        }
    }

    /// Mission time passes at that pace.
    pub fn set_pace(&mut self, pace: Pace) {
        self.latency_monitor.set_pace(pace);
    }

    /// Something was sent to the robot.
    pub const fn sent(&mut self, now_ns: u64) {
        self.latency_monitor.sent(now_ns);
    }

    /// It acknowledged something.
    pub const fn acknowledged(&mut self, now_ns: u64) {
        self.latency_monitor.acknowledged(now_ns);
    }

    /// Time passes.
    pub fn pass(&mut self, now_ns: u64) {
        self.latency_monitor.pass(now_ns);
    }

    /// Whether nothing is to be sent to the robot: what it acknowledges meanwhile tells its age.
    #[must_use]
    pub const fn awaits_late_ones(&self) -> bool {
        self.latency_monitor.asks()
    }

    /// The wheels were told these counts/s, forward positive.
    pub fn commanded(&mut self, counts: [i16; 2], now: MissionTime) {
        self.odometry.commanded(counts, now);
        self.stop_monitor.commanded(counts, now);
    }

    /// The robot answers since `now_ns`, `again` after it was lost, and was asked for its streams.
    pub fn found(&mut self, now_ns: u64, again: bool) {
        self.streams.found(now_ns);
        if again {
            self.latency_monitor.found(now_ns);
        }
    }

    /// The robot does not answer.
    pub const fn lost(&mut self) {
        self.restart.lost();
        self.latency_monitor.lost();
        self.stop_monitor.not_heard();
    }

    /// An operator lets the robot go on: what was wrong is taken for mended.
    pub fn reset(&mut self) {
        self.odometry.reset();
    }

    /// The front sonar's byte came; 0 is no reading.
    pub const fn range(&mut self, byte: u8, now_ns: u64) {
        if byte != 0 {
            self.streams.range(now_ns);
        }
    }

    /// Counts of a motor frame, growing forward, of a robot that was away until now or was not. Says what they are.
    pub fn motor(
        &mut self,
        counts: [u16; 2],
        was_away: bool,
        now: MissionTime,
        now_ns: u64,
    ) -> Counts {
        self.streams.motor(now, now_ns);
        let counts = counts.map(|count| count % COUNT_CYCLE);
        let are = self.restart.step(counts, now);
        match are {
            Counts::Follow => {
                self.odometry.believed(counts, now);
                self.stop_monitor.heard(counts, now);
            }
            Counts::Disbelieved => {
                self.odometry.implausible(now);
                self.stop_monitor.not_heard();
            }
            Counts::Restarted | Counts::Elsewhere => {
                if are == Counts::Restarted && was_away {
                    self.odometry.reset();
                } else {
                    self.odometry.implausible(now);
                }
                self.odometry.reset_counts();
                self.stop_monitor.reset_counts();
            }
        }
        are
    }

    /// Times the robot was seen to count anew.
    #[must_use]
    pub const fn restarts(&self) -> u32 {
        self.restart.restarts()
    }

    /// What the failsafe decides by; a robot that answers may send nothing for `silence` of the machine's clock.
    #[must_use]
    pub fn flags(&self, now: MissionTime, now_ns: u64, silence: Duration) -> failsafe::HealthFlags {
        failsafe::HealthFlags {
            does_not_stop: self.stop_monitor.does_not_stop(),
            odometry: self.odometry.belief(now),
            motor: self.streams.motor_frames(now_ns, silence),
            late: self.latency_monitor.suspected(),
            range_silent: self.streams.range_is_silent(now_ns, silence),
        }
    }

    /// Whether to ask for the streams again, now.
    pub fn wants_streams(&mut self, now_ns: u64, silence: Duration) -> bool {
        !self.latency_monitor.asks() && self.streams.wants_request(now_ns, silence)
    }

    /// Whether the encoders say that no wheel turns.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        self.stop_monitor.is_at_rest()
    }

    /// How the robot is told to stand.
    #[must_use]
    pub const fn stop_method(&self) -> StopMethod {
        self.stop_monitor.method()
    }

    /// Other means to make a robot stand that does not, when it is time for them.
    pub fn next_stop_method(&mut self, now: MissionTime) -> Option<StopMethod> {
        if !self.stop_monitor.does_not_stop() {
            self.tried = None;
            return None;
        }
        if self
            .tried
            .is_some_and(|tried| now.since(tried) < NEXT_METHOD_AFTER)
        {
            return None;
        }
        self.tried = Some(now);
        self.stop_monitor.try_next();
        Some(self.stop_monitor.method())
    }

    /// What an operator should know of `cause` besides its name: what was seen, and what to do about it.
    #[must_use]
    pub fn explain(&self, cause: Cause, now_ns: u64, silence: Duration) -> Option<String> {
        match cause {
            Cause::OdometryImplausible | Cause::OdometryGivenUp => {
                self.odometry.suspicion().map(|suspicion| suspicion.words().to_owned())
            }
            Cause::FramesSlow => match self.streams.motor_frames(now_ns, silence) {
                Motor::Slow(hz) => Some(format!(
                    "the robot sends {hz:.1} motor frames a second, one in {:.2} s, and a command lasts {:.2} s: let it send faster, or raise robot.command_limit_s",
                    1.0 / hz,
                    self.limit.as_secs_f64()
                )),
                _ => None,
            },
            Cause::FramesSilent => {
                Some("the robot answers and sends no motor frames; they are asked for".to_owned())
            }
            Cause::RangeSilent => Some(format!(
                "the front sonar, index {} of the standard frame (sonar.index), is missing or 0",
                self.sonar_index
            )),
            Cause::RobotLate => Some(
                "what it sends may be old: look at the network and the radio between, which hold it back".to_owned(),
            ),
            Cause::RobotDoesNotStop => Some(
                "it was told to stand and its encoders say that it moves; every method is tried in turn: velocity 0, disable, pulse width 0, suspend"
                    .to_owned(),
            ),
            _ => None,
        }
    }
}
