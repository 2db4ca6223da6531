//! Datagrams, accepted from the robot's address only.

use std::{
    io::{self, ErrorKind},
    net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket},
    os::fd::{AsFd, BorrowedFd},
};

use rustix::io::Errno;

use super::{Wire, counts::Tally};

#[derive(Debug)]
pub(super) struct Udp {
    socket: UdpSocket,
    robot: SocketAddr,
    tally: Tally,
}

impl Udp {
    /// Binds any free port.
    pub(super) fn open(robot: SocketAddr) -> io::Result<Self> {
        let any: IpAddr = match (robot.is_ipv4(), robot.ip().is_loopback()) {
            // Loopback sockets receive nothing from other machines.
            (true, true) => Ipv4Addr::LOCALHOST.into(),
            (false, true) => Ipv6Addr::LOCALHOST.into(),
            (true, false) => Ipv4Addr::UNSPECIFIED.into(),
            (false, false) => Ipv6Addr::UNSPECIFIED.into(),
        };
        let socket = UdpSocket::bind((any, 0))?;
        socket.set_nonblocking(true)?;
        Ok(Self { socket, robot, tally: Tally::default() })
    }
}

impl Wire for Udp {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        Some(self.socket.as_fd())
    }

    /// Drops and counts datagrams from other addresses.
    fn receive(&mut self, buffer: &mut [u8], _: u64) -> io::Result<Option<usize>> {
        loop {
            match self.socket.recv_from(buffer) {
                Ok((length, from)) if from == self.robot => return Ok(Some(length)),
                Ok((_, from)) => {
                    self.tally.foreign_datagrams += 1;
                    if from.ip() == self.robot.ip() && self.tally.other_port == 0 {
                        tracing::warn!(
                            port = from.port(),
                            expected = self.robot.port(),
                            "the robot's host answers from another port; check robot.address"
                        );
                        self.tally.other_port = from.port();
                    }
                }
                Err(error) => match error.kind() {
                    ErrorKind::WouldBlock => return Ok(None),
                    // A signal came, or the robot is unreachable.
                    ErrorKind::Interrupted
                    | ErrorKind::ConnectionRefused
                    | ErrorKind::HostUnreachable
                    | ErrorKind::NetworkUnreachable
                    | ErrorKind::NetworkDown => {}
                    _ => return Err(error),
                },
            }
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self.socket.send_to(bytes, self.robot) {
            Ok(_) => Ok(()),
            Err(error) if Errno::from_io_error(&error) == Some(Errno::BADF) => Err(error),
            // Full queue, firewall, or network down.
            Err(_) => {
                self.tally.unsent += 1;
                Ok(())
            }
        }
    }

    fn tally(&self) -> Tally {
        self.tally
    }
}
