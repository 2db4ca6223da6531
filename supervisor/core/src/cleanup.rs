//! When the bus is cleaned of what ended processes held: places on topics, shared memory, files of nodes.

use std::time::{Duration, Instant};

use common::bus::Bus;

use crate::{death::Death, stages};

/// How often the bus is cleaned at least: of consumers that ended, which is not notified.
const PERIOD: Duration = Duration::from_secs(1);
/// After a stage's death: another often follows within this, its successor's or of another stage.
const DELAY: Duration = Duration::from_millis(50);

/// What is to be cleaned up, and when that was last done.
pub(crate) struct Cleanup {
    done: Instant,
    /// Deaths since then, and when the last one was.
    deaths: (usize, Instant),
    /// Processes that ended and whose leftovers are not all removed.
    pending: Vec<u32>,
}

impl Cleanup {
    /// Nothing is to be cleaned up.
    pub(crate) fn new() -> Self {
        let now = Instant::now();
        Self {
            done: now,
            deaths: (0, now),
            pending: Vec::new(),
        }
    }

    /// These stages died, and their successors are started.
    pub(crate) fn on_deaths(&mut self, deaths: &[Death], bus: &Bus) {
        if deaths.is_empty() {
            return;
        }
        self.pending.extend(deaths.iter().map(|death| death.pid));
        self.deaths = (self.deaths.0 + deaths.len(), Instant::now());
        if deaths.iter().any(Death::was_refused) {
            // An ended process may still hold the place that it needs.
            self.run(bus);
        }
    }

    /// Clean up if it is time: after deaths, once no stage is starting, because a cleanup takes about as long as a start,
    /// which would wait for it; but sooner when so many died that places on the bus may run out.
    pub(crate) fn run_if_due(&mut self, bus: &Bus, any_starting: bool) {
        let (deaths, last) = self.deaths;
        let quiet = deaths > 0 && last.elapsed() >= DELAY && !any_starting;
        let many = deaths >= stages::TABLE.len();
        if quiet || many || self.done.elapsed() >= PERIOD {
            self.run(bus);
        }
    }

    /// What cannot be freed makes the bus slower, not wrong.
    fn run(&mut self, bus: &Bus) {
        self.done = Instant::now();
        self.deaths.0 = 0;
        match bus.clear_up(&self.pending) {
            Ok(true) => self.pending.clear(),
            Ok(false) => {}
            Err(error) => {
                let processes = std::mem::take(&mut self.pending);
                tracing::warn!(%error, ?processes, "cannot remove what ended processes left on the bus");
            }
        }
    }
}
