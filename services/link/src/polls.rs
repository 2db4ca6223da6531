//! Poll schedule for a robot that sends only on request.

use std::time::Duration;

use common::{clock::MissionTime, mission::Mission};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Polls {
    period_ns: u64,
    next: MissionTime,
}

impl Polls {
    pub(crate) fn new(mission: &Mission) -> Self {
        Self { period_ns: (1e9 / mission.robot.rate_hz) as u64, next: MissionTime::default() }
    }

    pub(crate) fn until_next(&self, now: MissionTime) -> Duration {
        self.next.since(now)
    }

    /// Takes a due poll. A late one does not delay the next, and missed ones are skipped.
    pub(crate) fn take_due(&mut self, now: MissionTime) -> bool {
        let is_due = self.until_next(now).is_zero();
        if is_due {
            let [after_next, after_now] =
                [self.next, now].map(|from| MissionTime(from.0.saturating_add(self.period_ns)));
            self.next = if after_next > now { after_next } else { after_now };
            assert!(self.next >= now);
        }
        is_due
    }
}
