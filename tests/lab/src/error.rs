//! The reasons why a bench ended early.

use std::{io, time::Duration};

use common::{bus::BusError, file::FileError, start::StageError};
use supervisor::{DomainError, simulator::SimulatorError, summary::Summary};
use thiserror::Error;

/// The time after which a sample is lost: a trip takes microseconds, the forwarders' start some milliseconds.
pub(crate) const LOST: Duration = Duration::from_secs(5);

#[derive(Debug, Error)]
pub enum BenchError {
    #[error(transparent)]
    Domain(#[from] DomainError),
    #[error(transparent)]
    Bus(#[from] BusError),
    /// A forwarder or a consumer reports the error from its own process.
    #[error(transparent)]
    Stage(#[from] StageError),
    #[error(transparent)]
    Simulator(#[from] SimulatorError),
    #[error(transparent)]
    File(#[from] FileError),
    #[error("cannot {action}: {source}")]
    System { action: &'static str, source: io::Error },
    #[error("no sample came back within {LOST:?}; is the machine overloaded?")]
    Lost,
    #[error("no forwarder stands for {0:?}")]
    Place(String),
    #[error("a mission gave no summary: {0}")]
    NoSummary(String),
    #[error("nothing was measured; does the mission drive at all?")]
    Nothing,
}

/// The system refused to do `action`.
pub(crate) fn system(action: &'static str) -> impl FnOnce(io::Error) -> BenchError {
    move |source| BenchError::System { action, source }
}

/// The summary that `firsthand run --json` printed; without one `said` is the error.
pub(crate) fn summary(stdout: &[u8], said: &[u8]) -> Result<Summary, BenchError> {
    serde_json::from_slice(stdout)
        .map_err(|_| BenchError::NoSummary(String::from_utf8_lossy(said).trim().to_owned()))
}
