//! Time in which the supervisor ran, the only time for deadlines: a standstill of the machine or of
//! this process makes no stage late.

use std::time::Duration;

use common::clock::Instant;

use crate::policy::Now;

/// Excess of a wait, or of the work between two, beyond which it does not count. A wait is usually
/// late by at most a hundredth of this.
const TOLERANCE: Duration = Duration::from_millis(20);

pub(crate) struct ObservedTime {
    observed: Now,
    until: Instant,
}

impl ObservedTime {
    pub(crate) const fn new(now: Instant) -> Self {
        Self { observed: Now::ZERO, until: now }
    }

    pub(crate) fn at(&self, now: Instant) -> Now {
        self.observed + self.since(now).min(TOLERANCE)
    }

    /// Records that a wait planned to take at most `planned` ended at `now`.
    ///
    /// Of a longer wait [`TOLERANCE`] counts, so that a supervisor that is always late still misses
    /// deadlines.
    pub(crate) fn on_waited(&mut self, planned: Duration, now: Instant) {
        let (took, before) = (self.since(now), self.at(now));
        self.observed += if took <= planned + TOLERANCE { took } else { TOLERANCE };
        self.until = now;
        assert!(self.observed >= before);
    }

    fn since(&self, now: Instant) -> Duration {
        now.saturating_duration_since(self.until)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn a_wait_counts_as_long_as_it_took() {
        let began = Instant::now();
        let mut time = ObservedTime::new(began);
        for wait in 1..=10 {
            time.on_waited(200 * MS, began + wait * 50 * MS);
        }
        assert_eq!(time.at(began + 500 * MS), 500 * MS);
    }

    #[test]
    fn a_stall_of_everything_does_not_count_wherever_it_falls() {
        let began = Instant::now();
        let mut time = ObservedTime::new(began);
        // The work between two waits stalls.
        assert_eq!(time.at(began + 600 * MS), TOLERANCE);
        for stall in 1..=5 {
            time.on_waited(200 * MS, began + stall * 600 * MS);
            assert_eq!(time.at(began + stall * 600 * MS), stall * TOLERANCE);
        }
    }
}
