//! A stage that was hit, until its successor works.

use std::time::{Duration, Instant};

use crate::{
    kind::Kind,
    signals::{Row, ms_since},
};

/// A stage that was hit, until its successor works.
pub(crate) struct PendingRecovery {
    pub(crate) stage: &'static str,
    pub(crate) kind: Kind,
    pub(crate) generation: u32,
    pub(crate) at: Instant,
    pub(crate) startup_hit: StartupHit,
    /// What is known of it.
    pub(crate) row: Row,
}

/// Whether the successor is to be hit in its first milliseconds.
#[derive(Clone, Copy)]
pub(crate) enum StartupHit {
    /// No.
    None,
    /// So long after its start.
    After(Duration),
    /// It has started, and is hit then.
    At {
        when: Instant,
        process: u32,
        generation: u32,
    },
}

impl PendingRecovery {
    /// Of `generation` of `stage`, hit now, which `row` says.
    pub(crate) fn new(
        stage: &'static str,
        generation: u32,
        startup_hit: StartupHit,
        row: Row,
    ) -> Self {
        Self {
            stage,
            kind: row.kind,
            generation,
            at: Instant::now(),
            startup_hit,
            row,
        }
    }

    /// The supervisor's record of the death was read.
    pub(crate) fn noticed(&mut self) {
        self.row.noticed_ms.get_or_insert_with(|| ms_since(self.at));
    }

    /// No wheel turns.
    pub(crate) fn rests(&mut self) {
        self.row.rest_ms.get_or_insert_with(|| ms_since(self.at));
    }
}
