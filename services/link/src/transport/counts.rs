//! The counts of a transport.

/// The counts of a transport.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Datagrams that were dropped because they came from another address than the robot's.
    pub foreign_datagrams: u64,
    /// The port of the first dropped datagram that came from the robot's host; 0 for none.
    pub other_port: u16,
    /// Messages to the robot that were lost because the wire did not accept them.
    pub unsent: u64,
}

/// The attempts to open a closed wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Attempts {
    /// Attempts since the robot last sent something.
    pub made: u64,
    /// Nanoseconds until the next attempt; 0 during an attempt.
    pub next_ns: u64,
}
