//! The transport of bytes to the robot: datagrams, a connection or a serial line. No call blocks. Bytes that cannot be sent now are lost.
//!
//! | module | holds |
//! |---|---|
//! | `udp` | datagrams from the robot's address only |
//! | `stream` | the common part of a connection and a serial line: it is reopened after each loss and sends no partial frame |
//! | `tcp` | a connection |
//! | `serial` | a serial line |
//! | `dds` | topics of ROS 2, with the feature `ros2` |
//! | `counts` | the counts of a transport |

mod counts;
#[cfg(feature = "ros2")]
mod dds;
mod serial;
mod stream;
mod tcp;
mod udp;

use std::{
    io,
    os::fd::{AsFd, BorrowedFd},
};

use common::{address::Address, mission::Mission, start::StageError};
use thiserror::Error;

pub use self::counts::{Attempts, Tally};
#[cfg(feature = "ros2")]
use self::dds::Dds;
use self::{serial::Serial, stream::Stream, tcp::Tcp, udp::Udp};

/// The wire cannot be opened or used, and the cause is this machine rather than the robot.
#[derive(Debug, Error)]
#[error(
    "no wire to the robot at {address}: {source}; raise the limit of open files (`ulimit -n`) or free ports, then start it again"
)]
pub struct TransportError {
    /// The robot's address.
    pub address: Address,
    /// The system's error.
    pub source: io::Error,
}

impl From<TransportError> for StageError {
    fn from(error: TransportError) -> Self {
        Self::Other(error.to_string())
    }
}

/// A wire to one robot.
#[derive(Debug)]
pub struct Transport {
    address: Address,
    wire: Wire,
    /// The last reported state: whether the wire was open.
    reported: Option<bool>,
    buffer: Box<[u8]>,
}

#[derive(Debug)]
enum Wire {
    Udp(Udp),
    Tcp(Stream<Tcp>),
    Serial(Stream<Serial>),
    #[cfg(feature = "ros2")]
    Dds(Box<Dds>),
}

impl Transport {
    /// A wire to the robot of `mission` at `address`. [`Transport::maintain`] opens a connection or a serial line.
    pub fn open(address: &Address, mission: &Mission) -> Result<Self, TransportError> {
        let wire = match address {
            Address::Udp(robot) => Udp::open(*robot).map(Wire::Udp),
            Address::Tcp(robot) => Stream::new(Tcp::to(*robot)).map(Wire::Tcp),
            Address::Serial(path) => Stream::new(Serial::of(path, mission)).map(Wire::Serial),
            Address::Ros2(domain) => ros2(domain.unwrap_or_default(), mission),
        };
        Ok(Self {
            wire: wire.map_err(|source| TransportError { address: address.clone(), source })?,
            address: address.clone(),
            reported: None,
            // The buffer holds the largest datagram.
            buffer: vec![0; 65_536].into_boxed_slice(),
        })
    }

    /// Reopen a closed wire if that is due at `now_ns` of the monotonic clock, and send the rest of a message. Returns whether the wire is
    /// open if that changed since the last report. If it closed and opened again, both changes are reported one after the other.
    pub fn maintain(&mut self, now_ns: u64) -> Result<Option<bool>, TransportError> {
        let closed_unreported = self.reported == Some(true) && !self.is_open();
        if !closed_unreported {
            let maintained = match &mut self.wire {
                Wire::Udp(_) => Ok(()),
                Wire::Tcp(stream) => stream.maintain(now_ns),
                Wire::Serial(stream) => stream.maintain(now_ns),
                #[cfg(feature = "ros2")]
                Wire::Dds(dds) => dds.maintain(now_ns),
            };
            maintained.map_err(|source| self.broken(source))?;
        }
        let open = Some(self.is_open());
        if self.reported == open {
            return Ok(None);
        }
        self.reported = open;
        Ok(open)
    }

    /// Whether the wire is open.
    pub const fn is_open(&self) -> bool {
        match &self.wire {
            Wire::Udp(_) => true,
            Wire::Tcp(stream) => stream.is_open(),
            Wire::Serial(stream) => stream.is_open(),
            #[cfg(feature = "ros2")]
            Wire::Dds(dds) => dds.is_open(),
        }
    }

    /// The next bytes from the robot; none when all were taken.
    pub fn receive(&mut self, now_ns: u64) -> Result<Option<&[u8]>, TransportError> {
        let received = match &mut self.wire {
            Wire::Udp(udp) => udp.receive(&mut self.buffer),
            Wire::Tcp(stream) => Ok(stream.receive(&mut self.buffer, now_ns)),
            Wire::Serial(stream) => Ok(stream.receive(&mut self.buffer, now_ns)),
            #[cfg(feature = "ros2")]
            Wire::Dds(dds) => Ok(dds.receive(&mut self.buffer, now_ns)),
        };
        match received {
            Ok(length) => Ok(length.and_then(|length| self.buffer.get(..length))),
            Err(source) => Err(self.broken(source)),
        }
    }

    /// Send a message, which has one frame or more; an empty message is not sent.
    pub fn send(&mut self, bytes: &[u8]) -> Result<(), TransportError> {
        if bytes.is_empty() {
            return Ok(());
        }
        let sent = match &mut self.wire {
            Wire::Udp(udp) => udp.send(bytes),
            Wire::Tcp(stream) => stream.send(bytes),
            Wire::Serial(stream) => stream.send(bytes),
            #[cfg(feature = "ros2")]
            Wire::Dds(dds) => {
                dds.send(bytes);
                Ok(())
            }
        };
        sent.map_err(|source| self.broken(source))
    }

    /// The counts so far.
    pub const fn tally(&self) -> Tally {
        match &self.wire {
            Wire::Udp(udp) => udp.tally(),
            Wire::Tcp(stream) => stream.tally(),
            Wire::Serial(stream) => stream.tally(),
            #[cfg(feature = "ros2")]
            Wire::Dds(dds) => dds.tally(),
        }
    }

    /// The attempts to open the wire, at `now_ns` of the monotonic clock; none while it is open.
    pub fn attempts(&self, now_ns: u64) -> Option<Attempts> {
        match &self.wire {
            Wire::Udp(_) => None,
            Wire::Tcp(stream) => stream.attempts(now_ns),
            Wire::Serial(stream) => stream.attempts(now_ns),
            #[cfg(feature = "ros2")]
            Wire::Dds(_) => None,
        }
    }

    fn broken(&self, source: io::Error) -> TransportError {
        TransportError { address: self.address.clone(), source }
    }
}

/// Whether this executable speaks ROS 2.
pub const SPEAKS_ROS2: bool = cfg!(feature = "ros2");

#[cfg(feature = "ros2")]
fn ros2(domain: u16, mission: &Mission) -> io::Result<Wire> {
    Dds::open(domain, ros2_driver::topics::Topics::of(mission)).map(|dds| Wire::Dds(Box::new(dds)))
}

#[cfg(not(feature = "ros2"))]
fn ros2(_: u16, _: &Mission) -> io::Result<Wire> {
    Err(io::Error::other("this executable speaks no ROS 2: build it with `--features ros2`"))
}

/// The descriptor is readable when the wire needs attention. It stays the same when the wire is reopened.
impl AsFd for Transport {
    fn as_fd(&self) -> BorrowedFd<'_> {
        match &self.wire {
            Wire::Udp(udp) => udp.as_fd(),
            Wire::Tcp(stream) => stream.as_fd(),
            Wire::Serial(stream) => stream.as_fd(),
            #[cfg(feature = "ros2")]
            Wire::Dds(dds) => dds.as_fd(),
        }
    }
}

#[cfg(test)]
mod tests;
