//! Counts of a transport.

use rustix::io::Errno;

#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    /// Datagrams dropped because their sender is not the robot's address.
    pub foreign_datagrams: u64,
    /// Port of the first dropped datagram from the robot's host; 0 for none.
    pub other_port: u16,
    /// Connections in a row that the robot ended soon after it had spoken on them.
    pub cut: u64,
    /// Messages that the wire did not accept.
    pub unsent: u64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Attempts {
    /// Attempts since the robot last sent something.
    pub made: u64,
    /// Time to the next attempt; 0 during one.
    pub next_ns: u64,
    /// Why the last one failed or the wire was closed, and the remedy, if that is known.
    pub failed: Option<(Errno, &'static str)>,
}
