//! Errors of a simulated robot.

use std::{io, net::SocketAddr, path::PathBuf};

use common::checkpoint::CheckpointError;
use thiserror::Error;

/// An error for which a simulated robot does not start or go on.
#[derive(Debug, Error)]
pub enum SimError {
    /// The address cannot be listened on.
    #[error(
        "the simulated robot cannot listen on {address}: {source}; stop what listens there, or give port 0 to take a free one"
    )]
    Bind {
        address: SocketAddr,
        /// The system's error.
        source: io::Error,
    },
    /// The system gives no pseudo-terminal.
    #[error("the simulated robot gets no pseudo-terminal: {0}; mount /dev/pts, or use UDP or TCP")]
    Line(#[source] io::Error),
    /// The transport failed later.
    #[error("the simulated robot can no longer listen on {address}: {source}; start it again")]
    Lost {
        /// The address it listened on.
        address: String,
        /// The system's error.
        source: io::Error,
    },
    /// The state cannot be saved.
    #[error(transparent)]
    Keep(#[from] CheckpointError),
    /// The file of its state is in use, or cannot be made.
    #[error("the simulated robot cannot have {file} to itself: {source}; give another file")]
    Lock {
        file: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// Waiting for the socket failed.
    #[error("the simulated robot cannot wait for its socket: {0}; start it again")]
    Wait(#[source] io::Error),
}
