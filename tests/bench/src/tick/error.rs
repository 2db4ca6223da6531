//! Why a tick could not be measured.

use std::{io, path::PathBuf, time::Duration};

use common::{bus::BusError, start::StageError};
use supervisor::DomainError;
use thiserror::Error;

/// A trip takes microseconds, the forwarders' start some milliseconds; a sample that takes longer is lost.
pub(super) const LOST: Duration = Duration::from_secs(5);

/// Why a tick could not be measured.
#[derive(Debug, Error)]
pub enum TickError {
    #[error(transparent)]
    Domain(#[from] DomainError),
    #[error(transparent)]
    Bus(#[from] BusError),
    /// A forwarder's or consumer's process, from within.
    #[error(transparent)]
    Stage(#[from] StageError),
    #[error("cannot {action}: {source}")]
    System { action: &'static str, source: io::Error },
    /// A sample went out and none came back.
    #[error("no sample came back within {LOST:?}; is the machine overloaded?")]
    Lost,
    #[error("no forwarder stands for {0:?}")]
    Place(String),
    /// A mission ended without a summary.
    #[error("the mission gave no summary: {0}")]
    NoSummary(String),
    #[error("nothing was measured; does the mission drive at all?")]
    Nothing,
    /// A file of measured times that cannot be read.
    #[error("{}: {problem}", file.display())]
    Times { file: PathBuf, problem: String },
}

/// The system refused to do `action`.
pub(super) fn system(action: &'static str) -> impl FnOnce(io::Error) -> TickError {
    move |source| TickError::System { action, source }
}
