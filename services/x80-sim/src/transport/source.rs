//! The source of received bytes.

use std::net::SocketAddr;

/// The source of received bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    /// A peer that sends datagrams.
    Peer(SocketAddr),
    /// The connection with this number.
    Connection(u64),
    /// The other end of the line.
    Line,
}

impl Source {
    /// Whether both are one host, which may send from another port after a restart.
    pub(crate) fn is_same_host(self, other: Self) -> bool {
        match (self, other) {
            (Self::Peer(one), Self::Peer(other)) => one.ip() == other.ip(),
            // Connections follow each other, and a line has one end.
            _ => true,
        }
    }
}
