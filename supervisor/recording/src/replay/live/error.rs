//! Errors of playing a recording.

use std::io;

use common::{bus::BusError, run::RunError};
use processes::{DomainError, process::ExitCause};
use thiserror::Error;

use crate::RecordingError;

pub(super) const NEVER_LIVE: &str = "link";
#[derive(Debug, Error)]
pub enum LiveError {
    #[error(transparent)]
    Domain(#[from] DomainError),
    #[error(transparent)]
    Bus(#[from] BusError),
    #[error(transparent)]
    Recording(#[from] RecordingError),
    #[error(transparent)]
    Run(#[from] RunError),
    #[error("cannot make the directory of the live stages: {0}; is $TMPDIR writable?")]
    Directory(io::Error),
    #[error("cannot start {stage}: {source}")]
    Start { stage: &'static str, source: io::Error },
    #[error("{stage} ended in tick {tick}: {cause}; its log ends: {log_tail:?}")]
    Ended {
        stage: &'static str,
        /// The tick that was played last.
        tick: u64,
        cause: ExitCause,
        log_tail: String,
    },
    #[error(
        "{NEVER_LIVE} cannot run live: a robot that does not obey its commands would be implausible to it; use `replay` without --live"
    )]
    Link,
}
