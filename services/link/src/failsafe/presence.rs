//! The presence monitor: whether the robot answers, and when to ping a robot that does not.

use std::time::Duration;

use common::{clock::Pace, mission::Mission, samples::Cause};

use super::monitor::{Condition, Moment, Monitor, Observation};
use crate::backoff::Backoff;

/// The silence after which a robot is lost, in command limits. It is longer than a short fade of the radio, and the robot's last
/// command has expired by then.
pub(crate) const SILENT_LIMITS: u32 = 3;
/// The least silence that counts, machine time: a process may be delayed by that much at any pace of mission time.
const LEAST_SILENCE: Duration = Duration::from_millis(100);
/// The pause between the first two pings of a robot that does not answer.
const FIRST_PAUSE: Duration = Duration::from_millis(200);
/// The longest pause between pings. A robot that waits for a ping is found only then; one that sends by itself is found at once.
const LONGEST_PAUSE: Duration = Duration::from_secs(2);

/// The absence of a robot that does not answer; times are of the machine's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Absence {
    /// Nanoseconds since the robot was lost, or since the first attempt to find it; 0 while it answers.
    pub lost_ns: u64,
    /// Pings since the robot was lost.
    pub pings: u64,
    /// Nanoseconds until the next ping.
    pub next_ping_ns: u64,
}

/// The longest time for which a present robot sends nothing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Silence {
    mission: Duration,
    machine: Duration,
}

impl Silence {
    pub(crate) fn new(mission: &Mission) -> Self {
        let limit = Duration::from_secs_f64(mission.robot.command_limit_s) * SILENT_LIMITS;
        Self { mission: limit, machine: limit }
    }

    pub(crate) fn set_pace(&mut self, pace: Pace) {
        self.machine = match pace {
            Pace::Rate(rate) if rate > 0.0 => self.mission.div_f64(rate).max(LEAST_SILENCE),
            _ => self.mission,
        };
    }

    /// Whether the silence is over at `now_ns` of the machine's clock if the last frame came at `heard_ns`.
    pub(crate) fn is_over(&self, heard_ns: u64, now_ns: u64) -> bool {
        now_ns.saturating_sub(heard_ns) >= self.machine.as_nanos() as u64
    }
}

/// The robot's presence on the wire.
#[derive(Clone, Debug)]
pub struct Presence {
    silence: Silence,
    wire_open: bool,
    connected: bool,
    heard_ns: Option<u64>,
    lost_since_ns: Option<u64>,
    pings: Backoff,
    losses: u64,
}

impl Presence {
    /// Whether the wire is open.
    pub const fn is_wire_open(&self) -> bool {
        self.wire_open
    }

    /// Whether the robot answers.
    pub const fn connected(&self) -> bool {
        self.connected
    }

    /// The number of times that the robot was lost.
    pub const fn losses(&self) -> u64 {
        self.losses
    }

    /// Note that a frame came. Returns whether the robot did not answer until now.
    pub fn heard(&mut self, now_ns: u64) -> bool {
        self.heard_ns = Some(now_ns);
        self.lost_since_ns = None;
        self.pings.reset();
        !std::mem::replace(&mut self.connected, true)
    }

    /// Whether the robot has sent nothing for longer than a present robot does.
    pub fn is_silent(&self, now_ns: u64) -> bool {
        self.heard_ns.is_none_or(|heard_ns| self.silence.is_over(heard_ns, now_ns))
    }

    /// Note that the robot is lost. Returns whether that is new.
    pub fn lose(&mut self, now_ns: u64) -> bool {
        let new = std::mem::replace(&mut self.connected, false);
        if new {
            self.lost_since_ns = Some(now_ns);
            self.losses += 1;
        }
        new
    }

    /// Note whether the wire is open. After a change the robot is pinged at once.
    pub const fn wire(&mut self, open: bool) {
        self.wire_open = open;
        self.pings.reset();
    }

    /// Whether a ping to a robot that does not answer is due.
    pub fn wants_ping(&mut self, now_ns: u64) -> bool {
        if self.connected {
            return false;
        }
        self.lost_since_ns.get_or_insert(now_ns);
        self.wire_open && self.pings.is_due(now_ns)
    }

    /// Note that the robot was pinged.
    pub fn pinged(&mut self, now_ns: u64) {
        if !self.connected {
            self.pings.attempted(now_ns);
        }
    }

    /// The robot's absence.
    pub fn absence(&self, now_ns: u64) -> Absence {
        if self.connected {
            return Absence::default();
        }
        Absence {
            lost_ns: self.lost_since_ns.map_or(0, |since| now_ns.saturating_sub(since)),
            pings: self.pings.attempts(),
            next_ping_ns: self.pings.wait_ns(now_ns),
        }
    }
}

impl Monitor for Presence {
    /// The wire counts as open until [`Presence::wire`] says otherwise.
    fn new(mission: &Mission) -> Self {
        Self {
            silence: Silence::new(mission),
            wire_open: true,
            connected: false,
            heard_ns: None,
            lost_since_ns: None,
            pings: Backoff::new(FIRST_PAUSE, LONGEST_PAUSE),
            losses: 0,
        }
    }

    fn observe(&mut self, what: &Observation<'_>, _: Moment) {
        if let Observation::Pace(pace) = *what {
            self.silence.set_pace(pace);
        }
    }

    fn condition(&self, _: Cause, _: Moment) -> Condition {
        (!self.connected).into()
    }

    fn judges_frames(&self) -> bool {
        false
    }
}
