//! Who bytes came from.

use std::net::SocketAddr;

/// Who bytes came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    /// A peer that sends datagrams.
    Peer(SocketAddr),
    /// The connection with this number.
    Connection(u64),
    /// Whoever is at the other end of the line.
    Line,
}
