use std::net::SocketAddr;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    Peer(SocketAddr),
    Connection(u64),
    Line,
}

impl Source {
    /// Returns whether both are one host; it may use another port after a restart.
    pub(crate) fn is_same_host(self, other: Self) -> bool {
        match (self, other) {
            (Self::Peer(one), Self::Peer(other)) => one.ip() == other.ip(),
            // Connections follow each other, and a line has one end.
            _ => true,
        }
    }
}
