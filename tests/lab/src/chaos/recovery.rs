//! The recovery of a stage that was hit, until its successor works.

use std::time::{Duration, Instant};

use common::samples::{RosterEntry, name_str};

use crate::chaos::signals::{Row, ms_since};

pub struct PendingRecovery {
    pub stage: &'static str,
    pub generation: u32,
    pub at: Instant,
    /// The time after its start at which the successor is to be hit too.
    pub startup_hit: Option<Duration>,
    pub row: Row,
}

impl PendingRecovery {
    pub fn new(stage: &'static str, generation: u32, row: Row) -> Self {
        Self { stage, generation, at: Instant::now(), startup_hit: None, row }
    }

    pub fn noticed(&mut self) {
        self.row.noticed_ms.get_or_insert_with(|| ms_since(self.at));
    }

    /// Note a sign of the successor: a ready beat, or a sample of a tick, which completes the measurement.
    pub fn sign(&mut self, beat: bool) -> bool {
        let took_ms = ms_since(self.at);
        self.row.ready_ms.get_or_insert(took_ms);
        if !beat {
            self.row.first_output_ms = Some(took_ms);
        }
        !beat
    }

    /// The successor among `entries` of a roster that was read at `read`, and the time at which it is to be hit in its start-up.
    pub fn startup_hit(
        &self,
        entries: &[RosterEntry],
        read: Instant,
    ) -> Option<(Instant, RosterEntry)> {
        let after = self.startup_hit?;
        let successor = entries.iter().find(|entry| {
            name_str(&entry.stage) == self.stage
                && entry.generation > self.generation
                && entry.pid != 0
        })?;
        let age = Duration::from_nanos(successor.uptime_ns);
        Some((read + after.saturating_sub(age), *successor))
    }
}
