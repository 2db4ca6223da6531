//! What the robot's frames say of the robot, held against what it was told: is it believed, does it obey, does what is
//! needed come.
//!
//! On a clock of ticks the robot is a simulated one, and no time passes by which to judge: it is believed.

use std::time::Duration;

use common::{
    clock::{MissionTime, Pace},
    mission::Mission,
    samples::Cause,
    wire::COUNT_CYCLE,
};

use crate::{
    failsafe,
    lateness::Lateness,
    obedience::{Means, Obedience},
    odometry::Odometry,
    restart::{Counts, RestartWatch},
    streams::{Motor, Streams},
};

/// A robot that does not obey is told to stand by other means after so long.
const NEXT_MEANS_AFTER: Duration = Duration::from_millis(300);

/// The senses of one robot.
#[derive(Clone, Debug)]
pub struct Senses {
    restart: RestartWatch,
    odometry: Odometry,
    obedience: Obedience,
    streams: Streams,
    lateness: Lateness,
    limit: Duration,
    sonar_index: u8,
    tried: Option<MissionTime>,
}

impl Senses {
    /// Of the robot of `mission`, of which nothing is known.
    #[must_use]
    pub fn new(mission: &Mission) -> Self {
        Self {
            restart: RestartWatch::new(mission),
            odometry: Odometry::new(mission),
            obedience: Obedience::new(mission),
            streams: Streams::new(mission),
            lateness: Lateness::new(mission),
            limit: Duration::from_secs_f64(mission.robot.command_limit_s),
            sonar_index: mission.sonar.index,
            tried: None,
        }
    }

    /// Mission time passes at that pace.
    pub fn set_pace(&mut self, pace: Pace) {
        self.lateness.set_pace(pace);
    }

    /// Something was sent to the robot.
    pub const fn sent(&mut self, now_ns: u64) {
        self.lateness.sent(now_ns);
    }

    /// It acknowledged something.
    pub const fn acknowledged(&mut self, now_ns: u64) {
        self.lateness.acknowledged(now_ns);
    }

    /// Time passes.
    pub fn pass(&mut self, now_ns: u64) {
        self.lateness.pass(now_ns);
    }

    /// Whether nothing is to be sent to the robot: what it acknowledges meanwhile tells its age.
    #[must_use]
    pub const fn awaits_late_ones(&self) -> bool {
        self.lateness.asks()
    }

    /// The wheels were told these counts/s, forward positive.
    pub fn commanded(&mut self, counts: [i16; 2], now: MissionTime) {
        self.odometry.commanded(counts, now);
        self.obedience.commanded(counts, now);
    }

    /// The robot answers since `now_ns`, `again` after it was lost, and was asked for its streams.
    pub fn found(&mut self, now_ns: u64, again: bool) {
        self.streams.found(now_ns);
        if again {
            self.lateness.found(now_ns);
        }
    }

    /// The robot does not answer.
    pub const fn lost(&mut self) {
        self.restart.lost();
        self.lateness.lost();
        self.obedience.unheard();
    }

    /// An operator lets the robot go on: what was wrong is taken for mended.
    pub fn forget(&mut self) {
        self.odometry.forget();
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
                self.obedience.heard(counts, now);
            }
            Counts::Disbelieved => {
                self.odometry.disbelieved(now);
                self.obedience.unheard();
            }
            Counts::Restarted | Counts::Elsewhere => {
                if are == Counts::Restarted && was_away {
                    self.odometry.forget();
                } else {
                    self.odometry.disbelieved(now);
                }
                self.odometry.forget_counts();
                self.obedience.forget_counts();
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
    pub fn flags(&self, now: MissionTime, now_ns: u64, silence: Duration) -> failsafe::Senses {
        failsafe::Senses {
            disobeys: self.obedience.disobeys(),
            odometry: self.odometry.belief(now),
            motor: self.streams.motor_frames(now_ns, silence),
            late: self.lateness.doubted(),
            range_silent: self.streams.range_is_silent(now_ns, silence),
        }
    }

    /// Whether to ask for the streams again, now.
    pub fn wants_streams(&mut self, now_ns: u64, silence: Duration) -> bool {
        !self.lateness.asks() && self.streams.wants_request(now_ns, silence)
    }

    /// Whether the encoders say that no wheel turns.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        self.obedience.is_at_rest()
    }

    /// How the robot is told to stand.
    #[must_use]
    pub const fn means(&self) -> Means {
        self.obedience.means()
    }

    /// Other means to make a robot stand that does not, when it is time for them.
    pub fn next_means(&mut self, now: MissionTime) -> Option<Means> {
        if !self.obedience.disobeys() {
            self.tried = None;
            return None;
        }
        if self
            .tried
            .is_some_and(|tried| now.since(tried) < NEXT_MEANS_AFTER)
        {
            return None;
        }
        self.tried = Some(now);
        self.obedience.try_next();
        Some(self.obedience.means())
    }

    /// What an operator should know of `cause` besides its name: what was seen, and what to do about it.
    #[must_use]
    pub fn explain(&self, cause: Cause, now_ns: u64, silence: Duration) -> Option<String> {
        match cause {
            Cause::OdometryImplausible | Cause::OdometryGivenUp => {
                self.odometry.doubt().map(|doubt| doubt.words().to_owned())
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
            Cause::RobotDisobeys => Some(
                "it was told to stand and its encoders say that it moves; every means is tried in turn: velocity 0, disable, pulse width 0, suspend"
                    .to_owned(),
            ),
            _ => None,
        }
    }
}
