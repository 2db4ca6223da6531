//! What to do with one stage: a pure function of what happened and when.
//!
//! ```text
//!          start            beat            exit
//!   Down ---------> Starting ----> Running ------> BackingOff --> Starting
//!                      |  too late    |  no beat, or  (not at all the first time)
//!                      |              |  no output         ^   |
//!                      +------------->+--> Aborted ---exit-+   | too many deaths
//!                      |              |   (abort, then kill)   v
//!                      +--replace---->+--> Replaced       Held -- released --> Starting
//!                      |              |        +-------exit-------------------> Starting
//!                      +--stop------->+--> Stopping --exit--> Down
//! ```
//! Other stages are not touched: a stage that cannot run is held, and the robot stands meanwhile. The one exception is a
//! bus on which it cannot start: that is recreated under all of them.

use std::{collections::VecDeque, time::Duration};

use crate::stages::Deadlines;

/// A stage that was ready for so long was stable: its next death is a first one.
const STABLE_AFTER: Duration = Duration::from_millis(500);
/// Wait before the second start in a row; doubles with each further one. Less than a start takes: one that is killed in
/// its start-up was mostly unlucky.
const FIRST_BACKOFF: Duration = Duration::from_millis(2);
/// The most to wait between starts: a person who repairs the cause should not wait longer.
const LONGEST_BACKOFF: Duration = Duration::from_secs(1);
/// A stage that died so often within [`HOLD_WINDOW`], or in a row without ever having been stable, is held: one that
/// cannot run at all gets here in two seconds, and no person or test kills the same stage that fast.
pub const HOLD_AFTER: usize = 12;
/// The window in which deaths are counted.
pub const HOLD_WINDOW: Duration = Duration::from_secs(10);
/// Starts in a row that the bus may have blocked, before it is recreated: one may have met what the generation before
/// left half made, which is removed when it ends.
const BLOCKED_STARTS: u32 = 2;
/// Time an aborted stage has to write the end of its log.
const ABORT_GRACE: Duration = Duration::from_millis(100);
/// Time a terminated stage has to stop in order. The link sends three datagrams in it.
const STOP_GRACE: Duration = Duration::from_millis(300);

/// A reading of the supervisor's clock: time since it started.
pub type Now = Duration;

/// What happened to a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Event {
    /// It has no process and should have one.
    Start,
    /// It could not be given one.
    StartFailed,
    /// It beat, not ready yet.
    BeatStarting,
    /// It beat, ready.
    BeatReady,
    /// It beats, and does not answer its inputs.
    OutputStale,
    /// Its process is gone and reaped.
    Exited,
    /// As exited, with the exit code for a bus that refused it.
    Refused,
    /// It should be replaced by a new generation; one that is held is released by it.
    Replace,
    /// It should stop for good.
    Stop,
    /// Time passed.
    Time,
}

/// What to do to a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Start a process.
    Start,
    /// SIGTERM.
    Terminate,
    /// SIGABRT: the stage hangs.
    Abort,
    /// SIGKILL.
    Kill,
    /// Stop all stages, recreate the bus, start them again.
    RecreateBus,
}

/// Where a stage is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Phase {
    /// No process, none wanted.
    Down,
    /// No process; one is started then.
    BackingOff {
        /// When.
        until: Now,
    },
    /// No process; it died too often, and only an operator starts it again.
    Held,
    /// A process that has not beaten as ready.
    Starting {
        /// Since when.
        since: Now,
    },
    /// A process that beats.
    Running {
        /// Since it was ready.
        since: Now,
        /// Its last beat.
        beat: Now,
    },
    /// A process that was not ready, without beat or without output for too long: it was aborted.
    Aborted {
        /// For how long it was ready.
        stability: Stability,
        /// When it is killed.
        kill: Now,
    },
    /// A process that was asked to stop for its successor; that is no death.
    Replaced {
        /// When it is killed.
        kill: Now,
    },
    /// A process that was asked to stop, and no successor is wanted.
    Stopping {
        /// When it is killed.
        kill: Now,
    },
}

/// For how long a generation was ready before its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stability {
    /// It never became ready.
    NeverReady,
    /// It was ready for less than [`STABLE_AFTER`].
    Brief,
    /// It was ready for [`STABLE_AFTER`].
    Stable,
}

impl Stability {
    /// Of one that was ready from `since` to its last sign, at `until`.
    fn of(since: Now, until: Now) -> Self {
        if until.saturating_sub(since) >= STABLE_AFTER {
            Self::Stable
        } else {
            Self::Brief
        }
    }
}

/// The policy for one stage.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Policy {
    deadlines: Deadlines,
    phase: Phase,
    /// Deaths in a row, none of a generation that was stable.
    deaths: usize,
    /// The deaths within the window; at most [`HOLD_AFTER`].
    recent: VecDeque<Now>,
    /// Starts in a row that the bus may have blocked.
    blocked_starts: u32,
}

impl Policy {
    /// For a stage that has never run and has these deadlines.
    pub fn new(deadlines: Deadlines) -> Self {
        Self {
            deadlines,
            phase: Phase::Down,
            deaths: 0,
            recent: VecDeque::with_capacity(HOLD_AFTER),
            blocked_starts: 0,
        }
    }

    /// Deaths within [`HOLD_WINDOW`], as of the last one.
    pub fn recent_deaths(&self) -> usize {
        self.recent.len()
    }

    /// Where the stage is.
    pub const fn phase(&self) -> Phase {
        self.phase
    }

    /// When [`Event::Time`] is next due; none when only other events matter.
    pub fn deadline(&self) -> Option<Now> {
        match self.phase {
            Phase::Down | Phase::Held => None,
            Phase::BackingOff { until } => Some(until),
            Phase::Starting { since } => Some(since + self.deadlines.startup),
            Phase::Running { beat, .. } => Some(beat + self.deadlines.heartbeat),
            Phase::Aborted { kill, .. } | Phase::Replaced { kill } | Phase::Stopping { kill } => {
                Some(kill)
            }
        }
    }

    /// What to do about `event`.
    pub fn step(&mut self, event: Event, now: Now) -> Option<Action> {
        let due = self.deadline().is_some_and(|deadline| now >= deadline);
        match (self.phase, event) {
            (Phase::Down | Phase::BackingOff { .. }, Event::Start) => Some(self.start(now)),
            (Phase::BackingOff { .. }, Event::Time) if due => Some(self.start(now)),
            (Phase::Held, Event::Start)
            | (Phase::BackingOff { .. } | Phase::Held, Event::Replace) => {
                self.deaths = 0;
                self.blocked_starts = 0;
                self.recent.clear();
                Some(self.start(now))
            }
            (Phase::Starting { .. }, Event::StartFailed) => {
                // Whatever is used up: not at once again.
                self.deaths = self.deaths.max(1);
                self.record_death(Stability::NeverReady, now)
            }

            (Phase::Starting { .. }, Event::BeatReady) => {
                self.blocked_starts = 0;
                let (since, beat) = (now, now);
                self.phase = Phase::Running { since, beat };
                None
            }
            (Phase::Running { since, .. }, Event::BeatReady) => {
                self.phase = Phase::Running { since, beat: now };
                None
            }

            (Phase::Starting { .. }, Event::Time) if due => self.abort(Stability::NeverReady, now),
            (Phase::Running { since, beat }, Event::Time) if due => {
                self.abort(Stability::of(since, beat), now)
            }
            (Phase::Running { since, .. }, Event::OutputStale) => {
                self.abort(Stability::of(since, now), now)
            }
            (Phase::Starting { .. } | Phase::Running { .. }, Event::Replace) => {
                let kill = now + STOP_GRACE;
                self.phase = Phase::Replaced { kill };
                Some(Action::Terminate)
            }
            (Phase::Aborted { kill, .. }, Event::Replace) => {
                self.phase = Phase::Replaced { kill };
                None
            }
            (
                Phase::Starting { .. }
                | Phase::Running { .. }
                | Phase::Aborted { .. }
                | Phase::Replaced { .. },
                Event::Stop,
            ) => {
                let kill = now + STOP_GRACE;
                self.phase = Phase::Stopping { kill };
                Some(Action::Terminate)
            }
            (
                Phase::Aborted { kill, .. } | Phase::Replaced { kill } | Phase::Stopping { kill },
                Event::Time,
            ) if now >= kill => {
                self.delay_kill(now);
                Some(Action::Kill)
            }

            (Phase::Starting { .. }, Event::Refused)
            | (
                Phase::Aborted {
                    stability: Stability::NeverReady,
                    ..
                },
                Event::Exited | Event::Refused,
            ) => self.record_blocked_start(now),
            (Phase::Starting { .. }, Event::Exited) => {
                self.record_death(Stability::NeverReady, now)
            }
            (Phase::Running { since, .. }, Event::Exited | Event::Refused) => {
                self.record_death(Stability::of(since, now), now)
            }
            (Phase::Aborted { stability, .. }, Event::Exited | Event::Refused) => {
                self.record_death(stability, now)
            }
            (Phase::Replaced { .. }, Event::Exited | Event::Refused) => Some(self.start(now)),
            (Phase::Stopping { .. }, Event::Exited | Event::Refused)
            | (Phase::BackingOff { .. } | Phase::Held, Event::Stop) => {
                self.phase = Phase::Down;
                None
            }
            _ => None,
        }
    }

    const fn start(&mut self, now: Now) -> Action {
        self.phase = Phase::Starting { since: now };
        Action::Start
    }

    fn abort(&mut self, stability: Stability, now: Now) -> Option<Action> {
        let kill = now + ABORT_GRACE;
        self.phase = Phase::Aborted { stability, kill };
        Some(Action::Abort)
    }

    /// SIGKILL cannot be refused, only delayed by the kernel: it is repeated.
    fn delay_kill(&mut self, now: Now) {
        if let Phase::Aborted { kill, .. } | Phase::Replaced { kill } | Phase::Stopping { kill } =
            &mut self.phase
        {
            *kill = now + ABORT_GRACE;
        }
    }

    /// A generation has ended that may not have got past the bus. Once recreated, the bus is not blamed again before a
    /// generation was ready.
    fn record_blocked_start(&mut self, now: Now) -> Option<Action> {
        self.blocked_starts = self.blocked_starts.saturating_add(1);
        let next = self.record_death(Stability::NeverReady, now);
        if self.blocked_starts == BLOCKED_STARTS && self.phase != Phase::Held {
            return Some(Action::RecreateBus);
        }
        next
    }

    fn record_death(&mut self, stability: Stability, now: Now) -> Option<Action> {
        if stability == Stability::Stable {
            self.deaths = 0;
        }
        self.deaths += 1;
        self.recent
            .retain(|then| now.saturating_sub(*then) < HOLD_WINDOW);
        self.recent.push_back(now);
        // One that is held, stopped and started again: no more are counted than make a difference.
        if self.recent.len() > HOLD_AFTER {
            self.recent.pop_front();
        }
        if self.recent.len() >= HOLD_AFTER || self.deaths >= HOLD_AFTER {
            self.phase = Phase::Held;
            return None;
        }
        if self.deaths == 1 {
            return Some(self.start(now));
        }
        let doublings = (self.deaths - 2).min(10) as u32;
        let backoff = (FIRST_BACKOFF * 2_u32.pow(doublings)).min(LONGEST_BACKOFF);
        self.phase = Phase::BackingOff {
            until: now + backoff,
        };
        None
    }
}

#[cfg(test)]
mod tests;
