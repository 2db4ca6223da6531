//! The recovery of a stage that was hit, until its successor works.

use std::time::{Duration, Instant};

use common::samples::{RosterEntry, name_str};

use crate::chaos::{
    kind::Kind,
    report::Recovery,
    signals::{Row, ms_since},
};

pub struct PendingRecovery {
    pub stage: &'static str,
    pub generation: u32,
    pub at: Instant,
    startup_hit: StartupHit,
    pub row: Row,
}

/// The hit of a successor in its first milliseconds, if any.
#[derive(Clone, Copy)]
pub enum StartupHit {
    None,
    /// The successor is to be hit this long after its start.
    After(Duration),
    /// The successor has started, and is hit at this time.
    At {
        when: Instant,
        process: u32,
        generation: u32,
    },
}

impl PendingRecovery {
    pub fn new(stage: &'static str, generation: u32, startup_hit: StartupHit, row: Row) -> Self {
        Self { stage, generation, at: Instant::now(), startup_hit, row }
    }

    pub fn noticed(&mut self) {
        self.row.noticed_ms.get_or_insert_with(|| ms_since(self.at));
    }

    pub fn rests(&mut self) {
        self.row.rest_ms.get_or_insert_with(|| ms_since(self.at));
    }

    /// Note a sign of the successor: a ready beat, or a sample of a tick. Returns whether the measurement is complete.
    pub fn sign(&mut self, beat: bool, recovery: &mut Recovery) -> bool {
        let took_ns = self.at.elapsed().as_nanos() as u64;
        let frozen = self.row.kind == Kind::Freeze;
        if self.row.ready_ms.is_none() {
            self.row.ready_ms = Some(ms_since(self.at));
            if frozen {
                recovery.after_freeze.record(took_ns);
            } else {
                recovery.ready.record(took_ns);
            }
        }
        if beat {
            return false;
        }
        self.row.first_output_ms = Some(ms_since(self.at));
        if !frozen {
            recovery.output.record(took_ns);
        }
        true
    }

    /// If the successor is to be hit in its start-up and is among `entries`, set the time of the hit.
    pub fn schedule_startup_hit(&mut self, entries: &[RosterEntry]) {
        let successor = entries.iter().find(|entry| {
            name_str(&entry.stage) == self.stage
                && entry.generation > self.generation
                && entry.pid != 0
        });
        if let (StartupHit::After(after), Some(entry)) = (self.startup_hit, successor) {
            let age = Duration::from_nanos(entry.uptime_ns);
            self.startup_hit = StartupHit::At {
                when: Instant::now() + after.saturating_sub(age),
                process: entry.pid,
                generation: entry.generation,
            };
        }
    }

    /// Time until the successor is to be hit in its start-up.
    pub fn time_to_startup_hit(&self) -> Option<Duration> {
        match self.startup_hit {
            StartupHit::At { when, .. } => Some(when.saturating_duration_since(Instant::now())),
            StartupHit::None | StartupHit::After(_) => None,
        }
    }

    /// Process and generation of the successor, once, when its hit is due.
    pub fn take_due_startup_hit(&mut self) -> Option<(u32, u32)> {
        match self.startup_hit {
            StartupHit::At { when, process, generation } if Instant::now() >= when => {
                self.startup_hit = StartupHit::None;
                Some((process, generation))
            }
            _ => None,
        }
    }
}
