//! Counts of a wire.

/// Counts of a wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Datagrams from another address than the robot's, dropped.
    pub foreign_datagrams: u64,
    /// The port from which the robot's host sent the first of them; 0 for none.
    pub other_port: u16,
    /// Messages to the robot that the wire did not take, lost.
    pub unsent: u64,
}

/// Attempts to open a wire that is down.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Attempts {
    /// Attempts since the robot last sent something.
    pub made: u64,
    /// Nanoseconds until the next one; 0 when one is under way.
    pub next_ns: u64,
}
