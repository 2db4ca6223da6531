//! Why a simulated robot could not start or go on.

use std::{io, net::SocketAddr, path::PathBuf};

use common::checkpoint::CheckpointError;
use thiserror::Error;

/// Why a simulated robot could not start or go on.
#[derive(Debug, Error)]
pub enum SimError {
    /// The address cannot be listened on.
    #[error(
        "the simulated robot cannot listen on {address}: {source}; stop what listens there, or give port 0 to take a free one"
    )]
    Bind {
        /// The address.
        address: SocketAddr,
        /// The system's word.
        source: io::Error,
    },
    /// No pseudo-terminal is to be had.
    #[error("the simulated robot gets no pseudo-terminal: {0}; mount /dev/pts, or use UDP or TCP")]
    Line(#[source] io::Error),
    /// The transport failed later.
    #[error("the simulated robot can no longer listen on {address}: {source}; start it again")]
    Lost {
        /// Where it listened.
        address: String,
        /// The system's word.
        source: io::Error,
    },
    /// Its state cannot be saved.
    #[error(transparent)]
    Keep(#[from] CheckpointError),
    /// The file of its state is in use, or cannot be made.
    #[error("the simulated robot cannot have {file} to itself: {source}; give another file")]
    Lock {
        /// The file.
        file: PathBuf,
        /// The system's word.
        source: io::Error,
    },
    /// The system would not let it wait.
    #[error("the simulated robot cannot wait for its socket: {0}; start it again")]
    Wait(#[source] io::Error),
}
