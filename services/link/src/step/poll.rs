//! Polls of robots that send only on request, and due times without input.

use std::time::Duration;

use common::clock::MissionTime;

use super::Link;
use crate::failsafe::monitor::Moment;

impl Link {
    /// None if neither is pending.
    pub(crate) fn until_due(&self, now: MissionTime) -> Option<Duration> {
        let polls = self.polls_by_time().then(|| self.polls.until_next(now));
        polls.into_iter().chain(self.repeat.map(|repeat| repeat.due.since(now))).min()
    }

    /// Returns whether the robot drives, and keeps doing so without input until `then`.
    pub(crate) fn is_calm_until(&self, then: Moment) -> bool {
        !self.in_ticks()
            && !self.decision.stops()
            && !self.failsafe.presence.is_silent(then.machine_ns)
            && self.failsafe.foresee(false, then) == self.decision
    }

    pub(super) fn keep_polling(&mut self) {
        if self.polls_by_time() && self.polls.take_due(self.now) {
            self.poll();
        }
    }

    fn polls_by_time(&self) -> bool {
        self.base.is_polled() && !self.in_ticks() && self.failsafe.presence.wire_open
    }

    /// Polls in lockstep after each command and ping; the robot begins one tick however many came.
    pub(super) fn poll_in_ticks(&mut self) {
        if self.base.is_polled() && self.in_ticks() {
            self.due = self.due.min(1);
            self.poll();
        }
    }

    fn poll(&mut self) {
        let asked = self.base.poll();
        if !asked.is_empty() {
            self.send(asked);
        }
    }
}
