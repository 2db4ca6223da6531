//! The bytes to and from the robot: datagrams, a connection or a serial line, which a `stream` reopens after each loss, or topics of ROS 2
//! with the feature `ros2`. No call blocks. Bytes that cannot be sent now are lost.

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

#[derive(Debug, Error)]
#[error(
    "no wire to the robot at {address}: {source}; raise the limit of open files (`ulimit -n`) or free ports, then start it again"
)]
pub struct TransportError {
    pub address: Address,
    pub source: io::Error,
}

impl From<TransportError> for StageError {
    fn from(error: TransportError) -> Self {
        Self::Other(error.to_string())
    }
}

#[derive(Debug)]
pub struct Transport {
    address: Address,
    wire: Wire,
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
    /// [`Transport::maintain`] opens a connection or serial line. Fails when this machine cannot.
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
            // The largest datagram has 64 kB, the largest message of ROS that is read 96 kB.
            buffer: vec![0; 131_072].into_boxed_slice(),
        })
    }

    /// Reopen a closed wire if due at `now_ns` of the monotonic clock, and send the rest of a message. Returns whether the wire is open
    /// if that changed since the last report; a close and a reopening are reported one after the other. Fails when this machine is the
    /// cause.
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

    pub const fn is_open(&self) -> bool {
        match &self.wire {
            Wire::Udp(_) => true,
            Wire::Tcp(stream) => stream.is_open(),
            Wire::Serial(stream) => stream.is_open(),
            #[cfg(feature = "ros2")]
            Wire::Dds(dds) => dds.is_open(),
        }
    }

    /// None when all were taken. Fails when this machine is the cause.
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

    /// A message of one frame or more; an empty one is not sent. Fails when this machine is the cause.
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

    pub const fn tally(&self) -> Tally {
        match &self.wire {
            Wire::Udp(udp) => udp.tally(),
            Wire::Tcp(stream) => stream.tally(),
            Wire::Serial(stream) => stream.tally(),
            #[cfg(feature = "ros2")]
            Wire::Dds(dds) => dds.tally(),
        }
    }

    /// None while the wire is open.
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

pub const SPEAKS_ROS2: bool = cfg!(feature = "ros2");

#[cfg(feature = "ros2")]
fn ros2(domain: u16, mission: &Mission) -> io::Result<Wire> {
    Dds::open(domain, ros2_driver::topics::Topics::of(mission)).map(|dds| Wire::Dds(Box::new(dds)))
}

#[cfg(not(feature = "ros2"))]
fn ros2(_: u16, _: &Mission) -> io::Result<Wire> {
    Err(io::Error::other("this executable speaks no ROS 2: build it with `--features ros2`"))
}

/// Readable when the wire needs attention; the same after a reopening.
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
