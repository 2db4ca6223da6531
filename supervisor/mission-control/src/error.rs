use std::io;

use common::{address::AddressError, bus::BusError, checkpoint::CheckpointError, run::RunError};
use processes::{DomainError, StageProcessError};
use thiserror::Error;

use crate::simulator::SimulatorError;

/// Refusal of the robot, its link, its supervisor or a command; `code` is for scripts.
#[derive(Debug, Error)]
#[error("{message}")]
pub struct Refused {
    pub code: &'static str,
    message: String,
}

impl Refused {
    pub fn new(code: &'static str, message: impl Into<String>) -> Self {
        let message = message.into();
        Self { code, message }
    }
}

pub fn refuse<T, E: From<Refused>>(code: &'static str, message: impl Into<String>) -> Result<T, E> {
    Err(Refused::new(code, message).into())
}

pub(crate) type Result<T = (), E = SupervisorError> = std::result::Result<T, E>;

#[derive(Debug, Error)]
pub enum SupervisorError {
    #[error(transparent)]
    Domain(#[from] DomainError),
    #[error(transparent)]
    Bus(#[from] BusError),
    #[error(transparent)]
    StageProcess(#[from] StageProcessError),
    #[error(transparent)]
    Simulator(#[from] SimulatorError),
    #[error(transparent)]
    Run(#[from] RunError),
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    #[error("robot.address: {0}")]
    Address(#[from] AddressError),
    #[error("cannot {action}: {source}")]
    System { action: &'static str, source: io::Error },
}

pub(crate) fn system(action: &'static str) -> impl FnOnce(io::Error) -> SupervisorError {
    move |source| SupervisorError::System { action, source }
}
