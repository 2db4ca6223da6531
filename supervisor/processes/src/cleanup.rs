//! Cleanup of ended processes' places on topics, shared memory and node files on the bus.

use std::time::{Duration, SystemTime};

use common::{bus::Bus, clock::Instant};

use crate::{death::Death, stages};

/// Least interval between cleanups of a bus that others join or leave.
const PERIOD: Duration = Duration::from_secs(1);
/// Interval of cleanups without that; a killed consumer leaves no sign.
const LONGEST: Duration = Duration::from_secs(5);
/// Delay after a stage's death.
///
/// Another death often follows. A starved recorder meanwhile reads the stage's last samples; with
/// 13 busy processes per core 250 ms were too short.
const DELAY: Duration = Duration::from_secs(1);

pub struct Cleanup {
    done: Instant,
    /// The bus's last change before `done`.
    changed: Option<SystemTime>,
    /// Deaths since `done`, and the time of the last one.
    deaths: (usize, Instant),
    /// Ended processes with resources left to free.
    pending: Vec<u32>,
}

impl Default for Cleanup {
    fn default() -> Self {
        let now = Instant::now();
        Self { done: now, changed: None, deaths: (0, now), pending: Vec::new() }
    }
}

impl Cleanup {
    /// Their successors have already started.
    pub fn on_deaths(&mut self, deaths: &[Death], bus: &Bus) {
        if deaths.is_empty() {
            return;
        }
        self.pending.extend(deaths.iter().map(|death| death.pid));
        self.deaths = (self.deaths.0 + deaths.len(), Instant::now());
        if deaths.iter().any(Death::was_refused) {
            // An ended process may hold the place that the successor needs.
            self.run(bus);
        }
    }

    /// Cleans up after deaths once no stage is starting, because a starting stage would wait. Many
    /// deaths hasten it, before places on the bus run out.
    pub fn run_if_due(&mut self, bus: &Bus, any_starting: bool) {
        let (deaths, last) = self.deaths;
        let rested = self.done.elapsed();
        let changed = || rested >= PERIOD && bus.changed() != self.changed;
        let due = deaths > 0 && !any_starting || rested >= LONGEST || changed();
        let quiet = last.elapsed() >= DELAY;
        let many = deaths >= stages::TABLE.len();
        if due && quiet || many {
            self.run(bus);
        }
    }

    /// Leftovers only slow the bus.
    fn run(&mut self, bus: &Bus) {
        self.done = Instant::now();
        self.deaths.0 = 0;
        let changed = bus.changed();
        let cleared = bus.clear_up(&self.pending);
        self.changed = changed.filter(|_| matches!(cleared, Ok(true)));
        match cleared {
            Ok(true) => self.pending.clear(),
            Ok(false) => {}
            Err(error) => {
                let processes = std::mem::take(&mut self.pending);
                tracing::warn!(%error, ?processes, "cannot free the resources of ended processes on the bus");
            }
        }
    }
}
