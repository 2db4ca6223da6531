//! TCP connection to the robot or its radio module.

use std::{io, net::SocketAddr, os::fd::OwnedFd, time::Duration};

use rustix::{
    io::Errno,
    net::{
        AddressFamily, SocketFlags, SocketType, connect, getpeername, getsockname, ipproto,
        socket_with, sockopt,
    },
};

use super::stream::Dial;

#[derive(Debug)]
pub(super) struct Tcp(pub(super) SocketAddr);

impl Dial for Tcp {
    /// The system does not report a peer that was switched off. The slowest robot sends every 2 s,
    /// and answers pings at once.
    const SILENCE: Option<Duration> = Some(Duration::from_secs(5));

    fn dial(&self) -> io::Result<OwnedFd> {
        let family = if self.0.is_ipv4() { AddressFamily::INET } else { AddressFamily::INET6 };
        let flags = SocketFlags::NONBLOCK | SocketFlags::CLOEXEC;
        let socket = socket_with(family, SocketType::STREAM, flags, Some(ipproto::TCP))?;
        match connect(&socket, &self.0) {
            Ok(()) | Err(Errno::INPROGRESS) => Ok(socket),
            Err(error) => Err(error.into()),
        }
    }

    fn finish(&self, socket: &OwnedFd) -> io::Result<()> {
        sockopt::socket_error(socket)??;
        // A socket can connect to itself on a port without a listener.
        if getpeername(socket)? == Some(getsockname(socket)?) {
            return Err(Errno::CONNREFUSED.into());
        }
        // Commands go out at once.
        sockopt::set_tcp_nodelay(socket, true)?;
        Ok(())
    }
}
