//! What to do with one stage: a pure function of what happened and when.
//!
//! ```text
//!          start            beat            exit
//!   Down ---------> Starting ----> Running ------> BackingOff --> Starting
//!                      |  too late    |  silent, or   (not at all the first time)
//!                      |              |  no output         ^   |
//!                      +------------->+--> Late ------exit-+   | too many deaths
//!                      |              |   (abort, then kill)   v
//!                      +--replace---->+--> Replaced       Held -- released --> Starting
//!                      |              |        +-------exit-------------------> Starting
//!                      +--stop------->+--> Stopping --exit--> Down
//! ```
//! Its siblings are not touched: a stage that cannot live holds itself, and the robot stands meanwhile. The one
//! exception is a bus that lets no life of it begin: that is made anew under all of them.

use std::{collections::VecDeque, time::Duration};

use crate::stages::Deadlines;

/// A stage that was ready for so long was well: its next death is a first one.
const WELL_AFTER: Duration = Duration::from_millis(500);
/// Wait before the second start in a row; doubles with each further one. Less than a start takes: one that is killed in
/// it was mostly unlucky.
const FIRST_BACKOFF: Duration = Duration::from_millis(2);
/// The most to wait between starts: a person who mends the cause should not wait longer.
const LONGEST_BACKOFF: Duration = Duration::from_secs(1);
/// A stage that died so often within [`HOLD_WINDOW`], or in a row without ever having been well, is held: one that
/// cannot live at all gets here in two seconds, and no person or test kills the same stage that fast.
pub const HOLD_AFTER: usize = 12;
/// The window in which deaths are counted.
pub const HOLD_WINDOW: Duration = Duration::from_secs(10);
/// Starts in a row that the bus may be to blame for, before it is made anew: one may have met what the life before
/// left half made, which is removed when it ends.
const BLOCKED_STARTS: u32 = 2;
/// Time an aborted stage has to write its last words.
const ABORT_GRACE: Duration = Duration::from_millis(100);
/// Time a terminated stage has to say goodbye. The link sends three datagrams in it.
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
    /// As exited, and it said that the bus would not have it.
    Refused,
    /// It should be replaced by a fresh life; if it is held, that life is its release.
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
    /// Stop all stages, make the bus anew, start them again.
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
    /// No process; it died too often, and only an operator's word starts it.
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
    /// A process that was not ready, silent or without output for too long: it was aborted.
    Late {
        /// How it had lived.
        lived: Lived,
        /// When it is killed.
        kill: Now,
    },
    /// A process that was told to make room for its successor; that is no death.
    Replaced {
        /// When it is killed.
        kill: Now,
    },
    /// A process that was told to go, and no successor is wanted.
    Stopping {
        /// When it is killed.
        kill: Now,
    },
}

/// How well a life went before its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Lived {
    /// It never became ready.
    Never,
    /// It was ready.
    Briefly,
    /// It was ready for [`WELL_AFTER`].
    Well,
}

impl Lived {
    /// From ready to last known well.
    fn ready(since: Now, until: Now) -> Self {
        if until.saturating_sub(since) >= WELL_AFTER {
            Self::Well
        } else {
            Self::Briefly
        }
    }
}

/// The policy for one stage.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Policy {
    deadlines: Deadlines,
    phase: Phase,
    /// Deaths in a row, none of a life long enough to be well.
    deaths: usize,
    /// When it died, within the window; at most [`HOLD_AFTER`].
    recent: VecDeque<Now>,
    /// Starts in a row that the bus may be to blame for.
    blocked_starts: u32,
}

impl Policy {
    /// For a stage that has never run and may be silent for so long.
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

    /// When [`Event::Time`] is next worth telling; none when only events move it.
    pub fn deadline(&self) -> Option<Now> {
        match self.phase {
            Phase::Down | Phase::Held => None,
            Phase::BackingOff { until } => Some(until),
            Phase::Starting { since } => Some(since + self.deadlines.startup),
            Phase::Running { beat, .. } => Some(beat + self.deadlines.heartbeat),
            Phase::Late { kill, .. } | Phase::Replaced { kill } | Phase::Stopping { kill } => {
                Some(kill)
            }
        }
    }

    /// What to do now.
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
                self.bury(Lived::Never, now)
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

            (Phase::Starting { .. }, Event::Time) if due => self.abort(Lived::Never, now),
            (Phase::Running { since, beat }, Event::Time) if due => {
                self.abort(Lived::ready(since, beat), now)
            }
            (Phase::Running { since, .. }, Event::OutputStale) => {
                self.abort(Lived::ready(since, now), now)
            }
            (Phase::Starting { .. } | Phase::Running { .. }, Event::Replace) => {
                let kill = now + STOP_GRACE;
                self.phase = Phase::Replaced { kill };
                Some(Action::Terminate)
            }
            (Phase::Late { kill, .. }, Event::Replace) => {
                self.phase = Phase::Replaced { kill };
                None
            }
            (
                Phase::Starting { .. }
                | Phase::Running { .. }
                | Phase::Late { .. }
                | Phase::Replaced { .. },
                Event::Stop,
            ) => {
                let kill = now + STOP_GRACE;
                self.phase = Phase::Stopping { kill };
                Some(Action::Terminate)
            }
            (
                Phase::Late { kill, .. } | Phase::Replaced { kill } | Phase::Stopping { kill },
                Event::Time,
            ) if now >= kill => {
                self.ask_again(now);
                Some(Action::Kill)
            }

            (Phase::Starting { .. }, Event::Refused)
            | (
                Phase::Late {
                    lived: Lived::Never,
                    ..
                },
                Event::Exited | Event::Refused,
            ) => self.bury_jammed(now),
            (Phase::Starting { .. }, Event::Exited) => self.bury(Lived::Never, now),
            (Phase::Running { since, .. }, Event::Exited | Event::Refused) => {
                self.bury(Lived::ready(since, now), now)
            }
            (Phase::Late { lived, .. }, Event::Exited | Event::Refused) => self.bury(lived, now),
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

    fn abort(&mut self, lived: Lived, now: Now) -> Option<Action> {
        let kill = now + ABORT_GRACE;
        self.phase = Phase::Late { lived, kill };
        Some(Action::Abort)
    }

    /// SIGKILL cannot be refused, only delayed by the kernel: ask again later.
    fn ask_again(&mut self, now: Now) {
        if let Phase::Late { kill, .. } | Phase::Replaced { kill } | Phase::Stopping { kill } =
            &mut self.phase
        {
            *kill = now + ABORT_GRACE;
        }
    }

    /// A life has ended that the bus did not let begin. Made anew once, it is not blamed again before a life begins.
    fn bury_jammed(&mut self, now: Now) -> Option<Action> {
        self.blocked_starts = self.blocked_starts.saturating_add(1);
        let next = self.bury(Lived::Never, now);
        if self.blocked_starts == BLOCKED_STARTS && self.phase != Phase::Held {
            return Some(Action::RecreateBus);
        }
        next
    }

    fn bury(&mut self, lived: Lived, now: Now) -> Option<Action> {
        if lived == Lived::Well {
            self.deaths = 0;
        }
        self.deaths += 1;
        self.recent
            .retain(|then| now.saturating_sub(*then) < HOLD_WINDOW);
        self.recent.push_back(now);
        // One that is held, stopped and started anew: no more are counted than make the difference.
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
