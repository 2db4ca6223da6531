use std::{
    io,
    path::{Path, PathBuf},
};

use common::{bus::BusError, domain::SHARED_MEMORY, file::FileError};
use thiserror::Error;

use crate::descriptors::NEEDED;

#[derive(Debug, Error)]
pub enum DomainError {
    #[error(
        "robot {robot:?} is already supervised by process {holder}; stop that process first, or choose another name with --robot"
    )]
    Supervised { robot: String, holder: String },
    /// Killed stages of an earlier supervisor still run.
    #[error(
        "robot {robot:?} is held by stages that survive a kill: {holders}; choose another name with --robot, or restart the machine"
    )]
    Orphans { robot: String, holders: String },
    #[error("{SHARED_MEMORY} {problem}; {remedy}")]
    SharedMemory { problem: String, remedy: &'static str },
    #[error(
        "a process may have {limit} descriptors here, but a supervisor needs {NEEDED}; raise the limit (`ulimit -Hn`, systemd: LimitNOFILE=)"
    )]
    Descriptors { limit: u64 },
    #[error("{path} belongs to another user; remove it, or run as its owner", path = path.display())]
    Foreign { path: PathBuf },
    #[error("{0}; check that it is writable and has free space")]
    File(#[from] FileError),
    #[error(transparent)]
    Bus(#[from] BusError),
}

pub(crate) fn failed(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> DomainError {
    let failed = FileError::of(action, path);
    move |source| DomainError::File(failed(source))
}
