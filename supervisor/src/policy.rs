//! What to do with one stage: a pure function of what happened and when.
//!
//! ```text
//!          start            beat            exit
//!   Down ---------> Starting ----> Running ------> BackingOff --> Starting
//!                      |  too late    |  silent        (not at all the first time)
//!                      +------------->+--> Failing --exit--^   |
//!                                          (abort, then kill)  | too many deaths in the window
//!                                                              v
//!                                                             Held -- released --> Starting
//! ```
//! Its siblings are not touched: a stage that cannot live holds itself, and the robot stands meanwhile.

use std::{collections::VecDeque, time::Duration};

use crate::stages::Stage;

/// A stage that lived so long was well: its next death is a first one.
const WELL_AFTER: Duration = Duration::from_millis(500);
/// Wait before the second start in a row; doubles with each further one.
const FIRST_BACKOFF: Duration = Duration::from_millis(50);
/// The most to wait between starts: a person who mends the cause should not wait longer.
const LONGEST_BACKOFF: Duration = Duration::from_secs(1);
/// A stage that died so often within [`HOLD_WINDOW`] is held: one that cannot live at all gets here in
/// seven seconds, and no person or test kills the same stage that fast.
const HOLD_AFTER: usize = 12;
/// The window in which deaths are counted.
const HOLD_WINDOW: Duration = Duration::from_secs(10);
/// Time an aborted stage has to write its last words.
const ABORT_GRACE: Duration = Duration::from_millis(100);
/// Time a terminated stage has to say goodbye. The link sends three datagrams in it.
const STOP_GRACE: Duration = Duration::from_millis(300);

/// A reading of the supervisor's clock: time since it started.
pub(crate) type Now = Duration;

/// What happened to a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Event {
    /// It beat, not ready yet.
    BeatStarting,
    /// It beat, ready.
    BeatReady,
    /// Its process is gone and reaped.
    Exited,
    /// It should be replaced by a fresh life; if it is held, that life is its release.
    Replace,
    /// It should stop for good.
    Stop,
    /// Time passed.
    Time,
}

/// What to do to a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Action {
    /// Start a process.
    Start,
    /// SIGTERM.
    Terminate,
    /// SIGABRT: the stage hangs.
    Abort,
    /// SIGKILL.
    Kill,
}

/// Where a stage is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Phase {
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
        /// Since its start.
        since: Now,
        /// Its last beat.
        beat: Now,
    },
    /// A process that was told to go, and will be killed then.
    Failing {
        /// When its life began.
        since: Now,
        /// When it is killed.
        kill: Now,
    },
    /// As failing, and no successor is wanted.
    Stopping {
        /// When it is killed.
        kill: Now,
    },
}

/// The policy for one stage.
#[derive(Clone, Debug)]
pub(crate) struct Policy {
    startup: Duration,
    heartbeat: Duration,
    phase: Phase,
    /// Deaths in a row, none of a life long enough to be well.
    deaths: u32,
    /// When it died, within the window; at most [`HOLD_AFTER`].
    recent: VecDeque<Now>,
}

impl Policy {
    /// For a stage that has never run.
    pub(crate) fn new(stage: &Stage) -> Self {
        Self {
            startup: stage.startup,
            heartbeat: stage.heartbeat,
            phase: Phase::Down,
            deaths: 0,
            recent: VecDeque::with_capacity(HOLD_AFTER),
        }
    }

    /// Deaths within [`HOLD_WINDOW`], as of the last one.
    pub(crate) fn recent_deaths(&self) -> usize {
        self.recent.len()
    }

    /// Where the stage is.
    pub(crate) const fn phase(&self) -> Phase {
        self.phase
    }

    /// Start the first life.
    pub(crate) fn start(&mut self, now: Now) -> Action {
        self.phase = Phase::Starting { since: now };
        Action::Start
    }

    /// When [`Event::Time`] is next worth telling; none when only events move it.
    pub(crate) fn deadline(&self) -> Option<Now> {
        match self.phase {
            Phase::Down | Phase::Held => None,
            Phase::BackingOff { until } => Some(until),
            Phase::Starting { since } => Some(since + self.startup),
            Phase::Running { beat, .. } => Some(beat + self.heartbeat),
            Phase::Failing { kill, .. } | Phase::Stopping { kill } => Some(kill),
        }
    }

    /// What to do now.
    pub(crate) fn step(&mut self, event: Event, now: Now) -> Option<Action> {
        match (self.phase, event) {
            (Phase::Starting { since } | Phase::Running { since, .. }, Event::BeatReady) => {
                self.phase = Phase::Running { since, beat: now };
                None
            }
            (
                Phase::Starting { since }
                | Phase::Running { since, .. }
                | Phase::Failing { since, .. },
                Event::Exited,
            ) => self.bury(since, now),
            (Phase::Starting { since } | Phase::Running { since, .. }, Event::Replace) => {
                self.phase = Phase::Failing {
                    since,
                    kill: now + STOP_GRACE,
                };
                Some(Action::Terminate)
            }
            (Phase::Starting { since } | Phase::Running { since, .. }, Event::Time)
                if self.deadline().is_some_and(|deadline| now >= deadline) =>
            {
                self.phase = Phase::Failing {
                    since,
                    kill: now + ABORT_GRACE,
                };
                Some(Action::Abort)
            }
            (Phase::Failing { kill, .. } | Phase::Stopping { kill }, Event::Time)
                if now >= kill =>
            {
                self.retry_kill(now);
                Some(Action::Kill)
            }
            (Phase::BackingOff { until }, Event::Time) if now >= until => Some(self.start(now)),
            (Phase::BackingOff { .. } | Phase::Held, Event::Replace) => {
                self.deaths = 0;
                self.recent.clear();
                Some(self.start(now))
            }
            (
                Phase::Starting { .. } | Phase::Running { .. } | Phase::Failing { .. },
                Event::Stop,
            ) => {
                self.phase = Phase::Stopping {
                    kill: now + STOP_GRACE,
                };
                Some(Action::Terminate)
            }
            (Phase::BackingOff { .. } | Phase::Held, Event::Stop)
            | (Phase::Stopping { .. }, Event::Exited) => {
                self.phase = Phase::Down;
                None
            }
            _ => None,
        }
    }

    /// SIGKILL cannot be refused, only delayed by the kernel: ask again later.
    fn retry_kill(&mut self, now: Now) {
        match &mut self.phase {
            Phase::Failing { kill, .. } | Phase::Stopping { kill } => *kill = now + ABORT_GRACE,
            _ => {}
        }
    }

    fn bury(&mut self, since: Now, now: Now) -> Option<Action> {
        if now.saturating_sub(since) >= WELL_AFTER {
            self.deaths = 0;
        }
        self.deaths += 1;
        self.recent
            .retain(|then| now.saturating_sub(*then) < HOLD_WINDOW);
        self.recent.push_back(now);
        if self.recent.len() >= HOLD_AFTER {
            self.phase = Phase::Held;
            return None;
        }
        if self.deaths == 1 {
            return Some(self.start(now));
        }
        let doublings = (self.deaths - 2).min(10);
        let backoff = (FIRST_BACKOFF * 2_u32.pow(doublings)).min(LONGEST_BACKOFF);
        self.phase = Phase::BackingOff {
            until: now + backoff,
        };
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::TABLE;

    const fn ms(count: u64) -> Duration {
        Duration::from_millis(count)
    }

    /// Of the link: beats due every 500 ms, ready due after 3 s.
    fn running() -> Policy {
        let mut policy = Policy::new(&TABLE[0]);
        assert_eq!(policy.start(ms(0)), Action::Start);
        assert_eq!(policy.step(Event::BeatStarting, ms(5)), None);
        assert_eq!(policy.step(Event::BeatReady, ms(10)), None);
        policy
    }

    #[test]
    fn the_first_death_is_answered_at_once() {
        let mut policy = running();
        assert_eq!(policy.step(Event::Exited, ms(20)), Some(Action::Start));
    }

    #[test]
    fn deaths_in_a_row_wait_longer_and_longer_up_to_a_second() {
        let mut policy = running();
        let mut now = ms(20);
        policy.step(Event::Exited, now);
        let mut waits = Vec::new();
        for _ in 0..7 {
            assert_eq!(policy.step(Event::Exited, now), None);
            let until = policy.deadline().unwrap();
            waits.push((until - now).as_millis());
            assert_eq!(policy.step(Event::Time, until - ms(1)), None);
            assert_eq!(policy.step(Event::Time, until), Some(Action::Start));
            now = until;
        }
        assert_eq!(waits, [50, 100, 200, 400, 800, 1000, 1000]);
    }

    /// Dies as soon as it is started, until it is held; the time of that.
    fn crash_until_held(policy: &mut Policy, mut now: Duration) -> Duration {
        loop {
            policy.step(Event::Exited, now);
            if policy.phase() == Phase::Held {
                return now;
            }
            if let Phase::BackingOff { until } = policy.phase() {
                now = until;
                assert_eq!(policy.step(Event::Time, now), Some(Action::Start));
            }
        }
    }

    #[test]
    fn a_stage_that_cannot_live_is_held_within_ten_seconds() {
        let mut policy = running();
        let held = crash_until_held(&mut policy, ms(20));
        assert!(held < Duration::from_secs(10), "{held:?}");
        let later = held + Duration::from_secs(3600);
        assert_eq!(policy.step(Event::Time, later), None);
        assert_eq!((policy.phase(), policy.deadline()), (Phase::Held, None));
    }

    #[test]
    fn a_released_stage_starts_with_a_clean_slate() {
        let mut policy = running();
        let held = crash_until_held(&mut policy, ms(20));
        assert_eq!(
            policy.step(Event::Replace, held + ms(1)),
            Some(Action::Start)
        );
        assert_eq!(
            policy.step(Event::Exited, held + ms(2)),
            Some(Action::Start)
        );
    }

    #[test]
    fn a_stage_killed_once_a_second_is_never_held() {
        let mut policy = running();
        for second in 1..1000 {
            policy.step(Event::Exited, ms(second * 1000));
            if let Some(until) = policy.deadline() {
                policy.step(Event::Time, until.max(ms(second * 1000)));
            }
            assert_ne!(policy.phase(), Phase::Held, "after {second} kills");
        }
    }

    #[test]
    fn a_life_that_was_well_clears_the_deaths_before_it() {
        let mut policy = running();
        policy.step(Event::Exited, ms(20));
        policy.step(Event::BeatReady, ms(30));
        assert_eq!(policy.step(Event::Exited, ms(2030)), Some(Action::Start));
    }

    #[test]
    fn a_stage_that_stops_beating_is_aborted_then_killed() {
        let mut policy = running();
        assert_eq!(policy.step(Event::Time, ms(509)), None);
        assert_eq!(policy.step(Event::Time, ms(510)), Some(Action::Abort));
        assert_eq!(policy.step(Event::Time, ms(609)), None);
        assert_eq!(policy.step(Event::Time, ms(610)), Some(Action::Kill));
        assert_eq!(policy.step(Event::Exited, ms(611)), Some(Action::Start));
    }

    #[test]
    fn a_stage_that_never_becomes_ready_is_aborted() {
        let mut policy = Policy::new(&TABLE[0]);
        policy.start(ms(0));
        policy.step(Event::BeatStarting, ms(2999));
        assert_eq!(policy.step(Event::Time, ms(3000)), Some(Action::Abort));
    }

    #[test]
    fn a_replaced_stage_is_asked_to_go_and_followed() {
        let mut policy = running();
        assert_eq!(policy.step(Event::Replace, ms(50)), Some(Action::Terminate));
        assert_eq!(policy.step(Event::Exited, ms(60)), Some(Action::Start));
    }

    #[test]
    fn a_stopped_stage_is_not_followed_and_killed_if_it_stays() {
        let mut policy = running();
        assert_eq!(policy.step(Event::Stop, ms(50)), Some(Action::Terminate));
        assert_eq!(policy.step(Event::Time, ms(350)), Some(Action::Kill));
        assert_eq!(policy.step(Event::Exited, ms(351)), None);
        assert_eq!(policy.phase(), Phase::Down);
        assert_eq!(policy.step(Event::Time, ms(9999)), None);
    }
}
