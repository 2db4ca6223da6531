//! Presence monitor: whether the robot answers, and when to ping it.

use std::time::Duration;

use common::{clock::Pace, mission::Mission, samples::Cause};

use super::monitor::{Condition, Moment, Monitor, Observation};
use crate::backoff::{Backoff, has_passed};

/// Least silence and least delay, machine time: a process may be delayed by this at any pace.
pub(super) const LEAST_SILENCE: Duration = Duration::from_millis(100);
const FIRST_PAUSE: Duration = Duration::from_millis(200);
/// Longest time to find a robot that waits for a ping; one that sends unasked is found at once.
const LONGEST_PAUSE: Duration = Duration::from_secs(2);

/// State of an absent robot, in machine time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Absence {
    /// Time since the loss, or since the first attempt to find the robot; 0 while it answers.
    pub lost_ns: u64,
    pub pings: u64,
    pub next_ping_ns: u64,
}

/// Longest silence of a present robot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Silence {
    mission: Duration,
    machine: Duration,
}

impl Silence {
    pub(crate) fn new(mission: &Mission) -> Self {
        let limit = Duration::from_secs_f64(mission.robot.silent_after_s());
        Self { mission: limit, machine: limit }
    }

    pub(crate) fn set_pace(&mut self, pace: Pace) {
        self.machine = match pace {
            Pace::Rate(rate) if rate > 0.0 => self.mission.div_f64(rate).max(LEAST_SILENCE),
            _ => self.mission,
        };
    }

    pub(crate) fn is_over(&self, heard_ns: u64, now_ns: u64) -> bool {
        has_passed(heard_ns, now_ns, self.machine)
    }
}

#[derive(Clone, Debug)]
pub struct Presence {
    silence: Silence,
    pub(crate) wire_open: bool,
    pub(crate) connected: bool,
    heard_ns: Option<u64>,
    lost_since_ns: Option<u64>,
    pings: Backoff,
    pub(crate) losses: u64,
}

impl Presence {
    /// Registers a frame. Returns whether the robot was silent before.
    pub fn heard(&mut self, now_ns: u64) -> bool {
        self.heard_ns = Some(now_ns);
        self.lost_since_ns = None;
        self.pings.reset();
        !std::mem::replace(&mut self.connected, true)
    }

    pub fn is_silent(&self, now_ns: u64) -> bool {
        self.heard_ns.is_none_or(|heard_ns| self.silence.is_over(heard_ns, now_ns))
    }

    /// Registers a loss. Returns whether it is new.
    pub fn lose(&mut self, now_ns: u64) -> bool {
        let new = std::mem::replace(&mut self.connected, false);
        assert!(!new || self.heard_ns.is_some() && self.lost_since_ns.is_none());
        if new {
            self.lost_since_ns = Some(now_ns);
            self.losses += 1;
        }
        new
    }

    /// Sets whether the wire is open. A change causes a ping at once.
    pub const fn wire(&mut self, open: bool) {
        self.wire_open = open;
        self.pings.reset();
    }

    pub fn wants_ping(&mut self, now_ns: u64) -> bool {
        if self.connected {
            return false;
        }
        self.lost_since_ns.get_or_insert(now_ns);
        self.wire_open && self.pings.is_due(now_ns)
    }

    pub fn pinged(&mut self, now_ns: u64) {
        if !self.connected {
            self.pings.attempted(now_ns);
        }
    }

    pub fn absence(&self, now_ns: u64) -> Absence {
        if self.connected {
            assert!(self.heard_ns.is_some() && self.lost_since_ns.is_none());
            return Absence::default();
        }
        Absence {
            lost_ns: self.lost_since_ns.map_or(0, |since| now_ns.saturating_sub(since)),
            pings: self.pings.attempts,
            next_ping_ns: self.pings.wait_ns(now_ns),
        }
    }
}

impl Monitor for Presence {
    /// Assumes an open wire until [`Presence::wire`].
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
