//! Byte transport to the robot: datagrams, a connection or a serial line.

mod memory;
mod owner;
mod pty;
mod tcp;
mod udp;

use std::{io, net::SocketAddr, os::fd::BorrowedFd, sync::mpsc::Sender};

use crate::error::{Result, SimError};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Transport {
    #[default]
    Udp,
    /// TCP connection, one host at a time.
    Tcp,
    /// Pseudo-terminal, opened by its path like a serial port.
    Pty,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    Peer(SocketAddr),
    Connection(u64),
    Line,
}

impl Source {
    /// Returns whether both are one host; it may use another port after a restart.
    pub fn is_same_host(self, other: Self) -> bool {
        match (self, other) {
            (Self::Peer(one), Self::Peer(other)) => one.ip() == other.ip(),
            // Connections follow each other, and a line has one end.
            _ => true,
        }
    }
}

trait Wire {
    /// Returns `address:port`, or the path of the line.
    fn address(&self) -> String;

    /// Becomes readable when bytes have come.
    fn readable(&self) -> Vec<BorrowedFd<'_>>;

    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<Option<(Source, usize)>>;

    fn send(&mut self, to: Source, bytes: &[u8]) -> io::Result<()>;

    /// Returns a peer that exists before it sends.
    fn connected(&mut self) -> io::Result<Option<Source>> {
        Ok(None)
    }

    /// Returns whether the newest bytes are the first since a host opened the line or connection. A
    /// reopened line counts only after DTR fell.
    fn take_opened(&mut self) -> bool {
        false
    }
}

/// Transport that drops bytes it cannot send.
pub struct Way(Box<dyn Wire>);

impl Way {
    pub fn open(transport: Transport, address: SocketAddr, own_user_only: bool) -> Result<Self> {
        let bound = |source| SimError::Bind { address, source };
        Ok(Self(match transport {
            Transport::Udp => Box::new(udp::Udp::bind(address, own_user_only).map_err(bound)?),
            Transport::Tcp => Box::new(tcp::Tcp::bind(address).map_err(bound)?),
            Transport::Pty => Box::new(pty::Pty::open().map_err(SimError::Line)?),
        }))
    }

    /// Sends datagrams, each with its receiver, to `host`, and receives none.
    pub fn to(host: Sender<(SocketAddr, Vec<u8>)>) -> Self {
        Self(Box::new(host))
    }

    pub fn connected(&mut self) -> Result<Option<Source>> {
        self.0.connected().map_err(|source| self.lost(source))
    }

    pub fn address(&self) -> String {
        self.0.address()
    }

    pub fn readable(&self) -> Vec<BorrowedFd<'_>> {
        self.0.readable()
    }

    pub fn take_opened(&mut self) -> bool {
        self.0.take_opened()
    }

    pub fn receive<'b>(&mut self, buffer: &'b mut [u8]) -> Result<Option<(Source, &'b [u8])>> {
        let received = self.0.receive(buffer).map_err(|source| self.lost(source))?;
        Ok(received.and_then(|(source, length)| Some((source, buffer.get(..length)?))))
    }

    pub fn send(&mut self, to: Source, bytes: &[u8]) {
        if let Err(error) = self.0.send(to, bytes) {
            tracing::debug!(?to, %error, "bytes to the host are lost");
        }
    }

    fn lost(&self, source: io::Error) -> SimError {
        SimError::Lost { address: self.address(), source }
    }
}
