//! Datagrams of a robot without a socket. Those to the robot do not come this way.

use std::{
    io::{self, ErrorKind},
    net::SocketAddr,
    os::fd::BorrowedFd,
    sync::mpsc::Sender,
};

use super::{Source, Wire, udp::LONGEST};

impl Wire for Sender<(SocketAddr, Vec<u8>)> {
    fn address(&self) -> String {
        "the simulation".to_owned()
    }

    fn readable(&self) -> Vec<BorrowedFd<'_>> {
        Vec::new()
    }

    fn receive(&mut self, _: &mut [u8]) -> io::Result<Option<(Source, usize)>> {
        Ok(None)
    }

    fn send(&mut self, to: Source, bytes: &[u8]) -> io::Result<()> {
        let Source::Peer(to) = to else {
            return Err(ErrorKind::NotConnected.into());
        };
        let mut pieces = bytes.chunks(LONGEST).map(|piece| (to, piece.to_vec()));
        pieces.try_for_each(|piece| Self::send(self, piece)).map_err(io::Error::other)
    }
}
