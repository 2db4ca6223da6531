//! The part of the step that polls a robot which says nothing unasked.

use std::time::Duration;

use common::{clock::MissionTime, mission::Mission};

use super::{Effect, Link};

/// The times at which a robot is polled.
#[derive(Clone, Copy, Debug)]
pub(super) struct Polls {
    period_ns: u64,
    next: MissionTime,
}

impl Polls {
    pub(super) fn new(mission: &Mission) -> Self {
        Self { period_ns: (1e9 / mission.robot.rate_hz) as u64, next: MissionTime::default() }
    }
}

impl Link {
    /// The mission time until the robot is polled next; none if that does not depend on time.
    pub(crate) fn until_poll(&self, now: MissionTime) -> Option<Duration> {
        let by_time = self.driver.is_polled() && !self.in_ticks();
        by_time.then(|| self.polls.next.since(now))
    }

    /// Poll a robot when a period has passed. A poll that is late does not delay the next, unless that is due by then.
    pub(super) fn keep_polling(&mut self, effects: &mut Vec<Effect>) {
        let is_open = self.monitors().presence.is_wire_open();
        if is_open && self.until_poll(self.now) == Some(Duration::ZERO) {
            let Polls { period_ns, next } = self.polls;
            let [after_next, after_now] =
                [next, self.now].map(|from| MissionTime(from.0.saturating_add(period_ns)));
            self.polls.next = if after_next > self.now { after_next } else { after_now };
            self.poll(effects);
        }
    }

    /// In lockstep the robot waits for commands and pings, so it is polled after each, and begins one tick however many came.
    pub(super) fn poll_in_ticks(&mut self, effects: &mut Vec<Effect>) {
        if self.driver.is_polled() && self.in_ticks() {
            self.due = self.due.min(1);
            self.poll(effects);
        }
    }

    fn poll(&mut self, effects: &mut Vec<Effect>) {
        let asked = self.driver.poll();
        if !asked.is_empty() {
            effects.push(Effect::Send(asked));
        }
    }
}
