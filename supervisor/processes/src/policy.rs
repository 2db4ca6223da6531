//! Policy for one stage: a pure function from events and their times to actions.
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
//! Other stages run on: a stage that cannot run is held, and the robot stands meanwhile. One
//! exception: a bus on which a stage cannot start is recreated, and all stages restart on it.

use std::{collections::VecDeque, time::Duration};

use crate::{activity::Activity, stages::Deadlines};

/// Ready time after which a generation is stable, which resets the count of deaths in a row.
pub const STABLE_AFTER: Duration = Duration::from_millis(500);
/// Wait before the second start in a row, doubled for each further one. Deaths at start-up are
/// mostly chance, so it is shorter than a start.
const FIRST_BACKOFF: Duration = Duration::from_millis(2);
/// Maximum wait between starts, short for a person who has repaired the cause.
const LONGEST_BACKOFF: Duration = Duration::from_secs(1);
/// Deaths within [`HOLD_WINDOW`], or in a row without a stable generation, after which a stage is
/// held.
///
/// A stage that cannot run is held after two seconds. People and tests kill a stage less often.
pub const HOLD_AFTER: usize = 12;
/// Window in which deaths are counted.
pub const HOLD_WINDOW: Duration = Duration::from_secs(10);
/// Starts in a row that the bus may have blocked before it is recreated. A single one may have met
/// incomplete files of the previous generation.
const BLOCKED_STARTS: u32 = 2;
const ABORT_GRACE: Duration = Duration::from_millis(100);
/// Time for a terminated stage to stop. The link sends three datagrams in it.
pub const STOP_GRACE: Duration = Duration::from_millis(300);

pub type Now = Duration;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    Start,
    StartFailed,
    BeatReady,
    /// The process beats, but does not answer its inputs.
    OutputStale,
    Exited,
    /// The process is reaped; by its exit code the bus refused it.
    Refused,
    /// Request for a new generation, which releases a held stage.
    Replace,
    Stop,
    /// Passage of time; all of it counts without the process's activity.
    Time(Option<Activity>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    Start,
    Terminate,
    /// SIGABRT: the stage hangs.
    Abort,
    Kill,
    /// Stop all stages, recreate the bus, start them again.
    RecreateBus,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Phase {
    /// No process, and none wanted.
    Down,
    BackingOff {
        until: Now,
    },
    /// No process until an operator starts the stage.
    Held,
    Starting {
        since: Now,
    },
    Running {
        since: Now,
        beat: Now,
    },
    /// Process aborted for missing readiness, beat or output.
    Aborted {
        stability: Stability,
        kill: Now,
    },
    /// Process asked to stop for its successor.
    Replaced {
        kill: Now,
    },
    /// Process asked to stop without a successor.
    Stopping {
        kill: Now,
    },
}

/// Time for which a generation was ready before its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stability {
    NeverReady,
    Brief,
    Stable,
}

impl Stability {
    fn of(since: Now, until: Now) -> Self {
        if until.saturating_sub(since) >= STABLE_AFTER { Self::Stable } else { Self::Brief }
    }
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Policy {
    deadlines: Deadlines,
    phase: Phase,
    /// Deaths in a row without a stable generation.
    deaths: usize,
    /// Deaths within the window; at most [`HOLD_AFTER`].
    recent: VecDeque<Now>,
    blocked_starts: u32,
}

impl Policy {
    pub fn new(deadlines: Deadlines) -> Self {
        Self {
            deadlines,
            phase: Phase::Down,
            deaths: 0,
            recent: VecDeque::with_capacity(HOLD_AFTER),
            blocked_starts: 0,
        }
    }

    /// Returns the deaths within [`HOLD_WINDOW`], as of the last one.
    pub fn recent_deaths(&self) -> usize {
        self.recent.len()
    }

    pub const fn phase(&self) -> Phase {
        self.phase
    }

    /// Returns the time of the next [`Event::Time`]; `None` if only other events matter.
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

    pub fn step(&mut self, event: Event, now: Now) -> Option<Action> {
        let due = self.deadline().is_some_and(|deadline| now >= deadline);
        let dies_often = self.deaths.max(self.recent.len()) >= HOLD_AFTER;
        assert!(dies_often || self.phase != Phase::Held);
        match (self.phase, event) {
            (Phase::Down | Phase::BackingOff { .. }, Event::Start)
            | (Phase::Replaced { .. }, Event::Exited | Event::Refused) => self.start(now),
            (Phase::BackingOff { .. }, Event::Time(_)) if due => self.start(now),
            (Phase::Held, Event::Start)
            | (Phase::BackingOff { .. } | Phase::Held, Event::Replace) => {
                self.deaths = 0;
                self.blocked_starts = 0;
                self.recent.clear();
                self.start(now)
            }
            (Phase::Starting { .. }, Event::StartFailed) => {
                // A resource is used up, so the next start waits.
                self.deaths = self.deaths.max(1);
                let next = self.record_death(Stability::NeverReady, now);
                assert_eq!(next, None);
                next
            }

            (Phase::Starting { .. }, Event::BeatReady) => {
                self.blocked_starts = 0;
                self.phase = Phase::Running { since: now, beat: now };
                None
            }
            (Phase::Running { since, .. }, Event::BeatReady) => {
                self.phase = Phase::Running { since, beat: now };
                None
            }

            (Phase::Starting { since }, Event::Time(activity))
                if due && is_hung(activity, now - since, self.deadlines.startup) =>
            {
                self.abort(Stability::NeverReady, now)
            }
            (Phase::Running { since, beat }, Event::Time(activity))
                if due && is_hung(activity, now - beat, self.deadlines.heartbeat) =>
            {
                self.abort(Stability::of(since, beat), now)
            }
            (Phase::Running { since, .. }, Event::OutputStale) => {
                self.abort(Stability::of(since, now), now)
            }
            (Phase::Starting { .. } | Phase::Running { .. }, Event::Replace) => {
                self.phase = Phase::Replaced { kill: now + STOP_GRACE };
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
                self.phase = Phase::Stopping { kill: now + STOP_GRACE };
                Some(Action::Terminate)
            }
            (
                Phase::Aborted { .. } | Phase::Replaced { .. } | Phase::Stopping { .. },
                Event::Time(_),
            ) if due => {
                self.delay_kill(now);
                Some(Action::Kill)
            }

            (Phase::Starting { .. }, Event::Refused)
            | (
                Phase::Aborted { stability: Stability::NeverReady, .. },
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
            (Phase::Stopping { .. }, Event::Exited | Event::Refused)
            | (Phase::BackingOff { .. } | Phase::Held, Event::Stop) => {
                self.phase = Phase::Down;
                None
            }
            _ => None,
        }
    }

    const fn start(&mut self, now: Now) -> Option<Action> {
        self.phase = Phase::Starting { since: now };
        Some(Action::Start)
    }

    fn abort(&mut self, stability: Stability, now: Now) -> Option<Action> {
        assert!(matches!(self.phase, Phase::Starting { .. } | Phase::Running { .. }));
        self.phase = Phase::Aborted { stability, kill: now + ABORT_GRACE };
        Some(Action::Abort)
    }

    /// SIGKILL is repeated, because the kernel may delay it.
    fn delay_kill(&mut self, now: Now) {
        if let Phase::Aborted { kill, .. } | Phase::Replaced { kill } | Phase::Stopping { kill } =
            &mut self.phase
        {
            assert!(*kill <= now);
            *kill = now + ABORT_GRACE;
        }
    }

    /// Records the end of a generation that the bus may have blocked. The bus is recreated once per
    /// ready generation.
    fn record_blocked_start(&mut self, now: Now) -> Option<Action> {
        const { assert!((BLOCKED_STARTS as usize) < HOLD_AFTER) };
        self.blocked_starts = self.blocked_starts.saturating_add(1);
        assert!(matches!(self.phase, Phase::Starting { .. } | Phase::Aborted { .. }));
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
        self.recent.retain(|then| now.saturating_sub(*then) < HOLD_WINDOW);
        self.recent.push_back(now);
        // A held stage that is stopped and started again can exceed [`HOLD_AFTER`].
        if self.recent.len() > HOLD_AFTER {
            self.recent.pop_front();
        }
        assert!(self.recent.len() <= HOLD_AFTER);
        if self.recent.len() >= HOLD_AFTER || self.deaths >= HOLD_AFTER {
            self.phase = Phase::Held;
            return None;
        }
        if self.deaths == 1 {
            return self.start(now);
        }
        assert!((2..HOLD_AFTER).contains(&self.deaths));
        let doublings = (self.deaths - 2).min(10) as u32;
        let backoff = (FIRST_BACKOFF * 2_u32.pow(doublings)).min(LONGEST_BACKOFF);
        assert!((FIRST_BACKOFF..=LONGEST_BACKOFF).contains(&backoff));
        self.phase = Phase::BackingOff { until: now + backoff };
        None
    }
}

fn is_hung(activity: Option<Activity>, age: Duration, deadline: Duration) -> bool {
    activity.is_none_or(|activity| activity.is_hung(age, deadline))
}

#[cfg(test)]
mod tests;
