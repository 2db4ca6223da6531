use std::{io, net::SocketAddr, path::PathBuf};

use common::checkpoint::CheckpointError;
use thiserror::Error;

pub type Result<T = (), E = SimError> = std::result::Result<T, E>;

#[derive(Debug, Error)]
pub enum SimError {
    #[error(
        "the simulated robot cannot listen on {address}: {source}; stop what listens there, or give port 0 to take a free one"
    )]
    Bind { address: SocketAddr, source: io::Error },
    #[error(
        "the simulated robot cannot open a pseudo-terminal: {0}; mount /dev/pts, or use UDP or TCP"
    )]
    Line(#[source] io::Error),
    #[error("the simulated robot can no longer listen on {address}: {source}; start it again")]
    Lost { address: String, source: io::Error },
    #[error(transparent)]
    Keep(#[from] CheckpointError),
    #[error("the simulated robot cannot lock {file}: {source}; give another file")]
    Lock { file: PathBuf, source: io::Error },
    #[error(
        "the simulated robot cannot send its pose to the other robot at {socket}: {source}; check that this user owns the socket's directory"
    )]
    Meet { socket: PathBuf, source: io::Error },
    #[error("the simulated robot cannot wait for its socket: {0}; start it again")]
    Wait(#[source] io::Error),
}
