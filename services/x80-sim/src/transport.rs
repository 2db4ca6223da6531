//! How bytes reach the robot: a UDP socket.

use std::{
    io::ErrorKind,
    net::{SocketAddr, UdpSocket},
    os::fd::{AsFd, BorrowedFd},
};

use crate::shell::SimError;

/// Who bytes came from.
pub(crate) type Source = SocketAddr;

/// An open way to the robot.
#[derive(Debug)]
pub(crate) struct Udp {
    socket: UdpSocket,
    address: SocketAddr,
}

impl Udp {
    /// Listen on `address`; port 0 takes a free one.
    pub(crate) fn bind(address: SocketAddr) -> Result<Self, SimError> {
        let bound = |source| SimError::Bind { address, source };
        let socket = UdpSocket::bind(address).map_err(bound)?;
        socket.set_nonblocking(true).map_err(bound)?;
        let address = socket.local_addr().map_err(bound)?;
        Ok(Self { socket, address })
    }

    /// Where it listens.
    pub(crate) fn address(&self) -> String {
        self.address.to_string()
    }

    /// What becomes readable when bytes have come.
    pub(crate) fn readable(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }

    /// The next datagram, if one has come.
    pub(crate) fn receive<'b>(
        &self,
        buffer: &'b mut [u8],
    ) -> Result<Option<(Source, &'b [u8])>, SimError> {
        loop {
            match self.socket.recv_from(buffer) {
                Ok((length, from)) => return Ok(Some((from, &buffer[..length]))),
                Err(error) => match error.kind() {
                    ErrorKind::WouldBlock => return Ok(None),
                    // An answer to a peer that has gone comes back as an error of ours.
                    ErrorKind::Interrupted
                    | ErrorKind::ConnectionRefused
                    | ErrorKind::ConnectionReset => {}
                    _ => {
                        return Err(SimError::Lost {
                            address: self.address(),
                            source: error,
                        });
                    }
                },
            }
        }
    }

    /// Send one datagram. What cannot be sent is lost, as on a radio.
    pub(crate) fn send(&self, to: Source, bytes: &[u8]) {
        if let Err(error) = self.socket.send_to(bytes, to) {
            tracing::debug!(%to, %error, "a datagram is lost");
        }
    }
}
