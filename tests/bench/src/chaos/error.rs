//! Why chaos ended early.

use common::bus::BusError;
use supervisor::simulator::SimulatorError;
use thiserror::Error;

use crate::chaos::signals::SignalsError;

/// Why chaos ended early.
#[derive(Debug, Error)]
pub enum ChaosError {
    #[error(transparent)]
    Bus(#[from] BusError),
    #[error(transparent)]
    Simulator(#[from] SimulatorError),
    #[error(transparent)]
    Signals(#[from] SignalsError),
    #[error("cannot {action}: {source}")]
    System { action: &'static str, source: std::io::Error },
    /// A mission ended without a summary.
    #[error("a mission gave no summary: {0}")]
    NoSummary(String),
}

/// The system refused to do `action`.
pub(crate) fn system(action: &'static str) -> impl FnOnce(std::io::Error) -> ChaosError {
    move |source| ChaosError::System { action, source }
}
