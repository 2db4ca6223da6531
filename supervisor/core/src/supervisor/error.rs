//! Why a run could not be carried out.

use std::io;

use common::{address::AddressError, bus::BusError, checkpoint::CheckpointError, run::RunError};
use thiserror::Error;

use crate::{domain::DomainError, simulator::SimulatorError, stage_processes::StageProcessError};

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
    StageProcesses(#[from] StageProcessError),
    /// The simulator.
    #[error(transparent)]
    Simulator(#[from] SimulatorError),
    /// The run file.
    #[error(transparent)]
    Run(#[from] RunError),
    /// What the supervisor keeps.
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
        /// The system's word.
        source: io::Error,
    },
}

pub(super) fn system(action: impl Into<String>) -> impl FnOnce(io::Error) -> SupervisorError {
    let action = action.into();
    move |source| SupervisorError::System { action, source }
}
