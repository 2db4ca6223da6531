//! TCP connection to the robot or its radio module.

use std::{fmt, io, net::SocketAddr, os::fd::OwnedFd, time::Duration};

use rustix::{
    io::Errno,
    net::{
        AddressFamily, SocketFlags, SocketType, connect, getpeername, getsockname, ipproto,
        socket_with, sockopt,
    },
};

use super::stream::Dial;

/// The system does not report a peer that was switched off. The slowest robot sends every 2 s, and
/// answers pings at once.
const SILENCE: Duration = Duration::from_secs(5);

#[derive(Debug)]
pub(super) struct Tcp {
    robot: SocketAddr,
}

impl Tcp {
    pub(super) const fn to(robot: SocketAddr) -> Self {
        Self { robot }
    }
}

impl fmt::Display for Tcp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "tcp://{}", self.robot)
    }
}

impl Dial for Tcp {
    const SILENCE: Option<Duration> = Some(SILENCE);

    fn dial(&self) -> io::Result<OwnedFd> {
        let family = if self.robot.is_ipv4() { AddressFamily::INET } else { AddressFamily::INET6 };
        let flags = SocketFlags::NONBLOCK | SocketFlags::CLOEXEC;
        let socket = socket_with(family, SocketType::STREAM, flags, Some(ipproto::TCP))?;
        match connect(&socket, &self.robot) {
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

    /// Does nothing: the system closes connections in the background.
    fn abandon(&self, _: &OwnedFd) {}
}
