//! The counts of a transport.

#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    /// Dropped, because they came from another address than the robot's.
    pub foreign_datagrams: u64,
    /// The first dropped datagram's from the robot's host; 0 for none.
    pub other_port: u16,
    /// Lost, because the wire did not accept them.
    pub unsent: u64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Attempts {
    /// Counted since the robot last sent something.
    pub made: u64,
    /// 0 during an attempt.
    pub next_ns: u64,
}
