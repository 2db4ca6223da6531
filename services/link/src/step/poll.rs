//! The part of the step that polls a robot which says nothing unasked.

use std::time::Duration;

use common::clock::MissionTime;

use super::{Effect, Link};

impl Link {
    /// Mission time; none if polls do not depend on time.
    pub(crate) fn until_poll(&self, now: MissionTime) -> Option<Duration> {
        let by_time = self.base.is_polled() && !self.in_ticks();
        by_time.then(|| self.polls.until_next(now))
    }

    pub(super) fn keep_polling(&mut self, effects: &mut Vec<Effect>) {
        let by_time = self.base.is_polled() && !self.in_ticks();
        if by_time && self.monitors().presence.is_wire_open() && self.polls.take_due(self.now) {
            self.poll(effects);
        }
    }

    /// The robot waits for commands and pings in lockstep: it is polled after each, and begins one tick however many came.
    pub(super) fn poll_in_ticks(&mut self, effects: &mut Vec<Effect>) {
        if self.base.is_polled() && self.in_ticks() {
            self.due = self.due.min(1);
            self.poll(effects);
        }
    }

    fn poll(&mut self, effects: &mut Vec<Effect>) {
        let asked = self.base.poll();
        if !asked.is_empty() {
            effects.push(Effect::Send(asked));
        }
    }
}
