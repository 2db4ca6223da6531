//! Whether the robot answers, and how it is looked for while it does not. The clock comes in as an argument.

use std::time::Duration;

use common::{clock::Pace, mission::Mission};

use crate::backoff::Backoff;

/// A robot that said nothing for so many command limits is lost: longer than a radio's short fade, and
/// the robot stands by then anyway.
pub(crate) const SILENT_LIMITS: u32 = 3;
/// However fast mission time runs, processes are late by so much now and then.
const LEAST_SILENCE: Duration = Duration::from_millis(100);
/// Between the first two pings of a robot that does not answer.
const FIRST_PAUSE: Duration = Duration::from_millis(200);
/// Between pings at most: a robot that says something is heard at once, and one that waits to be spoken to
/// can wait so long.
const LONGEST_PAUSE: Duration = Duration::from_secs(2);

/// How long the robot has not answered, and what is done about it. Times of the machine's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Absence {
    /// Since it was lost, or looked for first, nanoseconds; 0 while it answers.
    pub lost_ns: u64,
    /// Pings since.
    pub pings: u64,
    /// Until the next ping, nanoseconds.
    pub next_ping_ns: u64,
}

/// The robot's presence on the wire.
#[derive(Clone, Debug)]
pub struct Presence {
    /// How long it may say nothing in mission time, and on the machine's clock.
    limit: Duration,
    silence: Duration,
    wire_open: bool,
    connected: bool,
    heard_ns: Option<u64>,
    lost_since_ns: Option<u64>,
    pings: Backoff,
    losses: u64,
}

impl Presence {
    /// Of the robot of `mission`, which has not been heard yet, on a wire that is open.
    #[must_use]
    pub fn new(mission: &Mission) -> Self {
        let limit = Duration::from_secs_f64(mission.robot.command_limit_s) * SILENT_LIMITS;
        Self {
            limit,
            silence: limit,
            wire_open: true,
            connected: false,
            heard_ns: None,
            lost_since_ns: None,
            pings: Backoff::new(FIRST_PAUSE, LONGEST_PAUSE),
            losses: 0,
        }
    }

    /// Mission time passes at that pace.
    pub fn set_pace(&mut self, pace: Pace) {
        self.silence = match pace {
            Pace::Rate(rate) if rate > 0.0 => self.limit.div_f64(rate).max(LEAST_SILENCE),
            _ => self.limit,
        };
    }

    /// Whether it answers.
    #[must_use]
    pub const fn connected(&self) -> bool {
        self.connected
    }

    /// How long it may say nothing, by the machine's clock.
    #[must_use]
    pub const fn silence(&self) -> Duration {
        self.silence
    }

    /// Times it was lost.
    #[must_use]
    pub const fn losses(&self) -> u64 {
        self.losses
    }

    /// A frame of it came. Says whether it was away until now.
    pub fn heard(&mut self, now_ns: u64) -> bool {
        self.heard_ns = Some(now_ns);
        self.lost_since_ns = None;
        self.pings.reset();
        !std::mem::replace(&mut self.connected, true)
    }

    /// Whether it has said nothing for longer than a robot that is there does.
    #[must_use]
    pub fn is_silent(&self, now_ns: u64) -> bool {
        let limit = self.silence.as_nanos() as u64;
        self.heard_ns
            .is_none_or(|heard| now_ns.saturating_sub(heard) >= limit)
    }

    /// It is taken for lost. Says whether that is new.
    pub fn lose(&mut self, now_ns: u64) -> bool {
        let new = std::mem::replace(&mut self.connected, false);
        if new {
            self.lost_since_ns = Some(now_ns);
            self.losses += 1;
        }
        new
    }

    /// The wire is open now, or is not. Whoever is there then is asked at once.
    pub const fn wire(&mut self, open: bool) {
        self.wire_open = open;
        self.pings.reset();
    }

    /// Whether to ping a robot that does not answer, now.
    pub fn wants_ping(&mut self, now_ns: u64) -> bool {
        if self.connected {
            return false;
        }
        self.lost_since_ns.get_or_insert(now_ns);
        self.wire_open && self.pings.is_due(now_ns)
    }

    /// It was pinged.
    pub fn pinged(&mut self, now_ns: u64) {
        if !self.connected {
            self.pings.attempted(now_ns);
        }
    }

    /// How long it has been away.
    #[must_use]
    pub fn absence(&self, now_ns: u64) -> Absence {
        if self.connected {
            return Absence::default();
        }
        Absence {
            lost_ns: self
                .lost_since_ns
                .map_or(0, |since| now_ns.saturating_sub(since)),
            pings: self.pings.attempts(),
            next_ping_ns: self.pings.wait_ns(now_ns),
        }
    }
}
