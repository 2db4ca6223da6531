//! The options of a page that is served, and its errors.

use std::{io, net::SocketAddr, path::PathBuf};

use common::domain::RobotName;
use thiserror::Error;

/// The options of a page.
#[derive(Clone, Debug)]
pub struct Options {
    pub robot: RobotName,
    pub listen: SocketAddr,
    /// Names in addresses besides the one of `listen`.
    pub hosts: Vec<String>,
    /// Certificate chain and key, PEM.
    pub tls: Option<(PathBuf, PathBuf)>,
}

/// A page that cannot be served.
#[derive(Debug, Error)]
pub enum PageError {
    #[error(
        "{0} is no loopback address; serve it with --tls-cert and --tls-key, or listen on 127.0.0.1 and use a tunnel"
    )]
    NotLoopback(SocketAddr),
    #[error("cannot listen on {address}: {source}; choose another port with --listen")]
    Listen { address: SocketAddr, source: io::Error },
    #[error("cannot use {file} for TLS: {problem}; give a certificate chain and its key as PEM")]
    Tls { file: PathBuf, problem: String },
    #[error("{0} stands for every address; name the page with --host")]
    NoName(SocketAddr),
    #[error("cannot start the page: {0}")]
    System(#[from] io::Error),
}
