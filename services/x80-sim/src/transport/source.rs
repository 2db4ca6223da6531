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

impl Source {
    /// Whether both are of one host: a host may speak from another port after a restart.
    pub(crate) fn is_same_host(self, other: Self) -> bool {
        match (self, other) {
            (Self::Peer(one), Self::Peer(other)) => one.ip() == other.ip(),
            // Connections follow each other, and a line has one end.
            _ => true,
        }
    }
}
