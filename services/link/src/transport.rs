//! Transport of bytes to and from the robot: datagrams, a connection, a serial line, or ROS 2
//! topics (feature `ros2`). `stream` reopens lost connections and lines. Calls never block, and
//! bytes that cannot be sent now are lost.

mod counts;
#[cfg(feature = "ros2")]
mod dds;
mod serial;
mod stream;
mod tcp;
mod udp;

use std::{fmt, io, os::fd::BorrowedFd};

use common::{
    address::Address,
    driver::Refusal,
    machine::{self, MachineWire},
    mission::Mission,
    start::StageError,
};
use thiserror::Error;

pub use self::counts::{Attempts, Tally};
#[cfg(feature = "ros2")]
use self::dds::Dds;
use self::{serial::Serial, stream::Stream, tcp::Tcp, udp::Udp};
use crate::drivers;

#[derive(Debug, Error)]
#[error(
    "cannot open the wire to the robot at {address}: {source}; raise the limit of open files (`ulimit -n`) or free ports, then start again"
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

pub const BAUD: u32 = 115_200;
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Line {
    pub baud: u32,
    /// Whether the device needs DTR low. Opening the line raises it.
    pub lowers_dtr: bool,
}

pub const SPEAKS_ROS2: bool = cfg!(feature = "ros2");

/// Wire to a device. Errors are faults of this machine.
trait Wire: fmt::Debug {
    /// Returns what is readable when the wire needs attention, also after a reopening.
    fn descriptor(&self) -> Option<BorrowedFd<'_>>;

    /// Reopens the wire if due on the monotonic clock, and sends the rest of a message.
    fn maintain(&mut self, _now_ns: u64) -> io::Result<()> {
        Ok(())
    }

    fn is_open(&self) -> bool {
        true
    }

    /// Returns the next length; none when all were taken.
    fn receive(&mut self, buffer: &mut [u8], now_ns: u64) -> io::Result<Option<usize>>;

    /// Loses bytes that are not accepted now.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    fn tally(&self) -> Tally;

    /// Returns None while the wire is open.
    fn attempts(&self, _now_ns: u64) -> Option<Attempts> {
        None
    }
}

#[derive(Debug)]
pub struct Transport {
    address: Address,
    wire: Box<dyn Wire>,
    reported: Option<bool>,
    buffer: Box<[u8]>,
}

impl Transport {
    pub fn of_base(address: &Address, mission: &Mission) -> Result<Self, TransportError> {
        match address {
            Address::Ros2(domain) if !machine::is_simulated() => {
                Self::new(address, ros2(domain.unwrap_or_default(), mission))
            }
            _ => Self::open(address, Line { baud: drivers::base(mission).1, lowers_dtr: false }),
        }
    }

    pub fn open(address: &Address, line: Line) -> Result<Self, TransportError> {
        let wire = match address {
            _ if let Some(machine) = machine::simulated() => {
                Ok(Box::new(machine.wire(&address.to_string())) as Box<dyn Wire>)
            }
            Address::Udp(robot) => Udp::open(*robot).map(|udp| Box::new(udp) as Box<dyn Wire>),
            Address::Tcp(robot) => Stream::boxed(Tcp(*robot), address),
            Address::Serial(path) => Stream::boxed(Serial { path: path.clone(), line }, address),
            Address::Ros2(_) => {
                Err(io::Error::other("a sensor's own address cannot be a ROS 2 domain"))
            }
        };
        Self::new(address, wire)
    }

    fn new(address: &Address, wire: io::Result<Box<dyn Wire>>) -> Result<Self, TransportError> {
        Ok(Self {
            wire: wire.map_err(|source| TransportError { address: address.clone(), source })?,
            address: address.clone(),
            reported: None,
            // Datagrams have up to 64 kB, accepted ROS messages 96 kB.
            buffer: vec![0; 131_072].into_boxed_slice(),
        })
    }

    /// Maintains the wire. Returns whether it is open if that changed since the last report. A
    /// close and a reopening come separately.
    pub fn maintain(&mut self, now_ns: u64) -> Result<Option<bool>, TransportError> {
        // An unreported close is reported before the wire reopens.
        if self.reported != Some(true) || self.is_open() {
            self.wire.maintain(now_ns).map_err(|source| self.broken(source))?;
        }
        let open = Some(self.is_open());
        if self.reported == open {
            return Ok(None);
        }
        self.reported = open;
        Ok(open)
    }

    pub fn is_open(&self) -> bool {
        self.wire.is_open()
    }

    pub fn receive(&mut self, now_ns: u64) -> Result<Option<&[u8]>, TransportError> {
        match self.wire.receive(&mut self.buffer, now_ns) {
            Ok(length) => Ok(length.and_then(|length| self.buffer.get(..length))),
            Err(source) => Err(self.broken(source)),
        }
    }

    /// Sends whole frames; skips an empty message.
    pub fn send(&mut self, bytes: &[u8]) -> Result<(), TransportError> {
        if bytes.is_empty() {
            return Ok(());
        }
        self.wire.send(bytes).map_err(|source| self.broken(source))
    }

    /// Returns what is readable when the wire needs attention; `None` on a simulated machine.
    pub fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.wire.descriptor()
    }

    pub fn tally(&self) -> Tally {
        self.wire.tally()
    }

    pub fn attempts(&self, now_ns: u64) -> Option<Attempts> {
        self.wire.attempts(now_ns)
    }

    /// Returns whether the robot ends one connection after another, as it does for two programs
    /// that connect to it.
    pub fn is_cut(&self) -> bool {
        self.wire.tally().cut > 1
    }

    /// Returns why the robot cannot be heard, if that is known.
    pub fn trouble(&self) -> Option<Refusal> {
        let failed = self.wire.attempts(0).and_then(|attempts| attempts.failed);
        let (what, remedy) = match (failed, self.wire.tally().other_port) {
            _ if self.is_cut() => (
                "it ends each connection within seconds".to_owned(),
                "end the other program that connects to it, or find why it restarts",
            ),
            (Some((errno, remedy)), _) => (io::Error::from(errno).to_string(), remedy),
            (None, 0) => return None,
            (None, port) => {
                let what = format!("its host answers from port {port}");
                (what, "name that port in robot.address")
            }
        };
        Some(Refusal { input: self.address.to_string(), what, remedy: remedy.to_owned() })
    }

    fn broken(&self, source: io::Error) -> TransportError {
        TransportError { address: self.address.clone(), source }
    }
}

#[cfg(feature = "ros2")]
fn ros2(domain: u16, mission: &Mission) -> io::Result<Box<dyn Wire>> {
    Ok(Box::new(Dds::open(domain, ros2_driver::topics::Topics::of(mission))?))
}

#[cfg(not(feature = "ros2"))]
fn ros2(_: u16, _: &Mission) -> io::Result<Box<dyn Wire>> {
    Err(io::Error::other("this executable lacks ROS 2 support; build it with `--features ros2`"))
}

/// Wire of a simulated machine, which wakes the link itself.
impl Wire for Box<dyn MachineWire> {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        None
    }

    fn receive(&mut self, buffer: &mut [u8], _: u64) -> io::Result<Option<usize>> {
        Ok(MachineWire::receive(self.as_mut()).map(|bytes| {
            let length = bytes.len().min(buffer.len());
            buffer[..length].copy_from_slice(&bytes[..length]);
            length
        }))
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        if machine::is_killed() {
            return Err(io::Error::other("the simulation has killed this process"));
        }
        MachineWire::send(self.as_mut(), bytes);
        Ok(())
    }

    fn tally(&self) -> Tally {
        Tally::default()
    }
}

#[cfg(test)]
mod tests;
