//! The open file that a stage persists its state in.

use serde::Serialize;

use crate::{
    checkpoint::{Checkpoint, CheckpointError},
    journal::Journal,
};

/// The open file, by [`Persists`](crate::wiring::Persists).
#[derive(Debug, Default)]
pub enum Saved {
    /// Nothing is persisted.
    #[default]
    Nothing,
    /// The whole state each time.
    State(Checkpoint),
    /// Inputs since a snapshot.
    Journal(Journal),
}

impl Saved {
    /// Save the whole state.
    pub fn save(&mut self, state: &impl Serialize) -> Result<(), CheckpointError> {
        match self {
            Self::State(checkpoint) => checkpoint.save(state),
            Self::Nothing | Self::Journal(_) => Ok(()),
        }
    }

    pub(crate) fn append(&mut self, entry: &impl Serialize) -> Result<(), CheckpointError> {
        match self {
            Self::Journal(journal) => journal.append(entry),
            Self::Nothing | Self::State(_) => Ok(()),
        }
    }

    pub(crate) const fn is_journal_long(&self) -> bool {
        match self {
            Self::Journal(journal) => journal.is_long(),
            Self::Nothing | Self::State(_) => false,
        }
    }

    pub(crate) fn shorten_journal(
        &mut self,
        state: &impl Serialize,
    ) -> Result<(), CheckpointError> {
        match self {
            Self::Journal(journal) if journal.is_long() => journal.snapshot(state),
            _ => Ok(()),
        }
    }
}
