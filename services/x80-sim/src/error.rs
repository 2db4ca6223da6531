use std::{io, net::SocketAddr, path::PathBuf};

use common::checkpoint::CheckpointError;
use thiserror::Error;

pub(crate) type Result<T = (), E = SimError> = std::result::Result<T, E>;

#[derive(Debug, Error)]
pub enum SimError {
    #[error(
        "the simulated robot cannot listen on {address}: {source}; stop what listens there, or give port 0 to take a free one"
    )]
    Bind { address: SocketAddr, source: io::Error },
    #[error("the simulated robot gets no pseudo-terminal: {0}; mount /dev/pts, or use UDP or TCP")]
    Line(#[source] io::Error),
    #[error("the simulated robot can no longer listen on {address}: {source}; start it again")]
    Lost { address: String, source: io::Error },
    #[error(transparent)]
    Keep(#[from] CheckpointError),
    #[error("the simulated robot cannot have {file} to itself: {source}; give another file")]
    Lock { file: PathBuf, source: io::Error },
    #[error(
        "the simulated robot cannot tell the other where it is at {socket}: {source}; see that its directory is this user's"
    )]
    Meet { socket: PathBuf, source: io::Error },
    #[error("the simulated robot cannot wait for its socket: {0}; start it again")]
    Wait(#[source] io::Error),
}
