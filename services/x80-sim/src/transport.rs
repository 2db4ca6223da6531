//! Bytes to the robot: datagrams, a connection or a serial line.

mod owner;
mod pty;
mod source;
mod tcp;
mod udp;

use std::{io, net::SocketAddr, os::fd::BorrowedFd};

pub(crate) use self::source::Source;
use crate::error::SimError;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Transport {
    #[default]
    Udp,
    /// One host at a time.
    Tcp,
    /// A pseudo-terminal, opened by its path like a serial port.
    Pty,
}

/// Bytes that cannot be sent are lost.
#[derive(Debug)]
pub(crate) enum Way {
    Udp(udp::Udp),
    Tcp(tcp::Tcp),
    Pty(pty::Pty),
}

impl Way {
    pub(crate) fn open(
        transport: Transport,
        address: SocketAddr,
        own_user_only: bool,
    ) -> Result<Self, SimError> {
        let bound = |source| SimError::Bind { address, source };
        match transport {
            Transport::Udp => udp::Udp::bind(address, own_user_only).map(Self::Udp).map_err(bound),
            Transport::Tcp => tcp::Tcp::bind(address).map(Self::Tcp).map_err(bound),
            Transport::Pty => pty::Pty::open().map(Self::Pty).map_err(SimError::Line),
        }
    }

    /// A peer that exists before it sends anything: a connected host, or the other end of the line.
    pub(crate) fn connected(&mut self) -> Result<Option<Source>, SimError> {
        let connected = match self {
            Self::Udp(_) => Ok(None),
            Self::Tcp(tcp) => tcp.connected(),
            Self::Pty(_) => Ok(Some(Source::Line)),
        };
        connected.map_err(|source| SimError::Lost { address: self.address(), source })
    }

    /// `address:port`, or the path of the line.
    pub(crate) fn address(&self) -> String {
        match self {
            Self::Udp(udp) => udp.address().to_string(),
            Self::Tcp(tcp) => tcp.address().to_string(),
            Self::Pty(pty) => pty.path().to_owned(),
        }
    }

    /// Readable when bytes have come; the second only if there are two.
    pub(crate) fn readable(&self) -> (BorrowedFd<'_>, Option<BorrowedFd<'_>>) {
        match self {
            Self::Udp(udp) => (udp.readable(), None),
            Self::Tcp(tcp) => tcp.readable(),
            Self::Pty(pty) => (pty.readable(), None),
        }
    }

    /// The newest bytes are the first on a line or connection that a host opened. A line that a host closed so that
    /// DTR stays high does not count as opened again.
    pub(crate) fn take_opened(&mut self) -> bool {
        match self {
            Self::Udp(_) => false,
            Self::Tcp(tcp) => tcp.take_opened(),
            Self::Pty(pty) => pty.take_opened(),
        }
    }

    pub(crate) fn receive<'b>(
        &mut self,
        buffer: &'b mut [u8],
    ) -> Result<Option<(Source, &'b [u8])>, SimError> {
        let received = match self {
            Self::Udp(udp) => udp.receive(buffer),
            Self::Tcp(tcp) => tcp.receive(buffer),
            Self::Pty(pty) => pty.receive(buffer),
        };
        match received {
            Ok(Some((source, length))) => Ok(buffer.get(..length).map(|bytes| (source, bytes))),
            Ok(None) => Ok(None),
            Err(source) => Err(SimError::Lost { address: self.address(), source }),
        }
    }

    pub(crate) fn send(&mut self, to: Source, bytes: &[u8]) {
        let sent = match (self, to) {
            (Self::Udp(udp), Source::Peer(peer)) => udp.send(peer, bytes),
            (Self::Tcp(tcp), Source::Connection(number)) => tcp.send(number, bytes),
            (Self::Pty(pty), Source::Line) => pty.send(bytes),
            _ => Err(io::ErrorKind::NotConnected.into()),
        };
        if let Err(error) = sent {
            tracing::debug!(?to, %error, "bytes to the host are lost");
        }
    }
}
