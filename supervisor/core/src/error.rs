//! Why a run could not be carried out.

use std::io;

use common::{address::AddressError, bus::BusError, checkpoint::CheckpointError, run::RunError};
use thiserror::Error;

use crate::{
    domain_error::DomainError, simulator::SimulatorError, stage_process::StageProcessError,
};

/// Why a run could not be carried out.
#[derive(Debug, Error)]
pub enum SupervisorError {
    /// The domain.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// A stage.
    #[error(transparent)]
    StageProcess(#[from] StageProcessError),
    /// The simulator.
    #[error(transparent)]
    Simulator(#[from] SimulatorError),
    /// The run file.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The supervisor's checkpoint.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The robot's address.
    #[error("robot.address: {0}")]
    Address(#[from] AddressError),
    /// The file system or the system.
    #[error("cannot {action}: {source}")]
    System {
        /// What was tried.
        action: String,
        /// The system's error.
        source: io::Error,
    },
}

/// The system refused to do `action`.
pub(crate) fn system(action: impl Into<String>) -> impl FnOnce(io::Error) -> SupervisorError {
    let action = action.into();
    move |source| SupervisorError::System { action, source }
}
