//! The part of the step that polls a robot which says nothing unasked, and says when the step is due without input.

use std::time::Duration;

use common::clock::MissionTime;

use super::{Effect, Link};
use crate::failsafe::monitor::Moment;

impl Link {
    /// Mission time until the next poll or repeated command; none if neither depends on time.
    pub(crate) fn until_due(&self, now: MissionTime) -> Option<Duration> {
        let polls = self.polls_by_time().then(|| self.polls.until_next(now));
        let repeat = self.repeat.map(|repeat| repeat.due.since(now));
        polls.into_iter().chain(repeat).min()
    }

    /// Whether the robot drives, and goes on as it does if nothing comes until `then`.
    pub(crate) fn is_calm_until(&self, then: Moment) -> bool {
        !self.in_ticks()
            && !self.decision.stops()
            && !self.monitors().presence.is_silent(then.machine_ns)
            && self.failsafe.foresee(false, then) == self.decision
    }

    pub(super) fn keep_polling(&mut self, effects: &mut Vec<Effect>) {
        if self.polls_by_time() && self.polls.take_due(self.now) {
            self.poll(effects);
        }
    }

    fn polls_by_time(&self) -> bool {
        self.base.is_polled() && !self.in_ticks() && self.monitors().presence.is_wire_open()
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
