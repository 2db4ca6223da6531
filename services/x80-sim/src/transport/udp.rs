use std::{
    io::{self, ErrorKind},
    net::{SocketAddr, UdpSocket},
    os::fd::{AsFd, BorrowedFd},
};

use super::{Source, Wire, owner::OwnUser};

/// Maximum datagram, below UDP's limit of 65,507 bytes. Lines with a scan of thousands of beams
/// take several.
pub const LONGEST: usize = 60_000;

pub struct Udp {
    socket: UdpSocket,
    address: SocketAddr,
    /// Sender filter; none admits every sender.
    own_user: Option<OwnUser>,
}

impl Udp {
    pub fn bind(address: SocketAddr, own_user_only: bool) -> io::Result<Self> {
        let socket = UdpSocket::bind(address)?;
        socket.set_nonblocking(true)?;
        let address = socket.local_addr()?;
        Ok(Self { socket, address, own_user: own_user_only.then(OwnUser::default) })
    }
}

impl Wire for Udp {
    fn address(&self) -> String {
        self.address.to_string()
    }

    fn readable(&self) -> Vec<BorrowedFd<'_>> {
        vec![self.socket.as_fd()]
    }

    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<Option<(Source, usize)>> {
        loop {
            match self.socket.recv_from(buffer) {
                Ok((_, from)) if self.own_user.as_mut().is_some_and(|own| !own.admits(from)) => {}
                Ok((length, from)) => return Ok(Some((Source::Peer(from), length))),
                Err(error) => match error.kind() {
                    ErrorKind::WouldBlock => return Ok(None),
                    // An answer to a vanished peer comes back as an error here.
                    ErrorKind::Interrupted
                    | ErrorKind::ConnectionRefused
                    | ErrorKind::ConnectionReset => {}
                    _ => return Err(error),
                },
            }
        }
    }

    fn send(&mut self, to: Source, bytes: &[u8]) -> io::Result<()> {
        let Source::Peer(to) = to else {
            return Err(ErrorKind::NotConnected.into());
        };
        bytes.chunks(LONGEST).try_for_each(|piece| self.socket.send_to(piece, to).map(drop))
    }
}
