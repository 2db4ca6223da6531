//! Why a robot's domain could not be locked or its bus made.

use std::{
    io,
    path::{Path, PathBuf},
};

use common::{bus::BusError, domain::SHARED_MEMORY};
use thiserror::Error;

/// Why a robot's domain cannot be had.
#[derive(Debug, Error)]
pub enum DomainError {
    /// Another supervisor holds it.
    #[error(
        "robot {robot:?} is already supervised by process {holder}; stop that first, or give this one another name with --robot"
    )]
    Supervised {
        /// The robot.
        robot: String,
        /// What the lock file says.
        holder: String,
    },
    /// Stages of an earlier supervisor still run although they were killed.
    #[error(
        "robot {robot:?} is held by stages that do not end even when killed: {holders}; give this one another name with --robot, or restart the machine"
    )]
    Orphans {
        /// The robot.
        robot: String,
        /// Their process ids.
        holders: String,
    },
    /// Shared memory is missing or full.
    #[error("{SHARED_MEMORY} {problem}; {remedy}")]
    SharedMemory {
        /// What is wrong.
        problem: String,
        /// What to do.
        remedy: &'static str,
    },
    /// The process may not have enough descriptors.
    #[error(
        "a process may have {limit} descriptors here, and a supervisor needs 256; raise the limit (`ulimit -Hn`, systemd: LimitNOFILE=)"
    )]
    Descriptors {
        /// The limit.
        limit: u64,
    },
    /// The directory belongs to another user.
    #[error("{path} belongs to another user; remove it, or run as its owner", path = path.display())]
    Foreign {
        /// The directory.
        path: PathBuf,
    },
    /// The file system refused.
    #[error("cannot {action} {path}: {source}; is it writable and not full?", path = path.display())]
    File {
        /// What was tried.
        action: &'static str,
        /// Where.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
}

/// `action` on the file or directory `path` failed.
pub(crate) fn failed(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> DomainError {
    let path = path.to_path_buf();
    move |source| DomainError::File {
        action,
        path,
        source,
    }
}
