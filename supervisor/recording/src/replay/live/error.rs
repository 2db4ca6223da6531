//! Why a recording cannot be played.

use std::io;

use common::{bus::BusError, run::RunError};
use supervisor::{DomainError, process::ExitCause};
use thiserror::Error;

use crate::RecordingError;

/// The stage that has no live process.
pub(super) const NEVER_LIVE: &str = "x80-link";
/// Why a recording cannot be played.
#[derive(Debug, Error)]
pub enum LiveError {
    /// The robot's name is taken, or its shared memory cannot be made.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// Shared memory.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The run file for the live stages.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The directory of logs and the run file.
    #[error("cannot make the directory of the live stages: {0}; is $TMPDIR writable?")]
    Directory(io::Error),
    /// A stage's process.
    #[error("cannot start {stage}: {source}")]
    Start {
        /// Which.
        stage: &'static str,
        /// What the system reports.
        source: io::Error,
    },
    /// It ended.
    #[error("{stage} ended in tick {tick}: {cause}; its last words: {words:?}")]
    Ended {
        /// Which.
        stage: &'static str,
        /// What was played last.
        tick: u64,
        /// How.
        cause: ExitCause,
        /// The end of its log.
        words: String,
    },
    /// Not a stage that can be live.
    #[error(
        "{NEVER_LIVE} cannot run live: it would doubt a robot that does not do what it is told now; `replay` without --live feeds it what it heard"
    )]
    Link,
}
