//! The socket: datagrams from the robot's address, and from nowhere else.

use std::{
    io,
    net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket},
    os::fd::{AsFd, BorrowedFd},
};

/// A UDP wire to one robot.
#[derive(Debug)]
pub struct Transport {
    socket: UdpSocket,
    robot: SocketAddr,
    strangers: u64,
    buffer: Box<[u8]>,
}

impl Transport {
    /// A wire to the robot at `robot`, from any free port.
    ///
    /// # Errors
    /// When the system has no socket or port.
    pub fn open(robot: SocketAddr) -> io::Result<Self> {
        let any = match robot.ip() {
            // On loopback bind to it: nothing from outside can even arrive.
            IpAddr::V4(ip) if ip.is_loopback() => IpAddr::V4(Ipv4Addr::LOCALHOST),
            IpAddr::V6(ip) if ip.is_loopback() => IpAddr::V6(Ipv6Addr::LOCALHOST),
            IpAddr::V4(_) => IpAddr::V4(Ipv4Addr::UNSPECIFIED),
            IpAddr::V6(_) => IpAddr::V6(Ipv6Addr::UNSPECIFIED),
        };
        let socket = UdpSocket::bind((any, 0))?;
        socket.set_nonblocking(true)?;
        Ok(Self {
            socket,
            robot,
            strangers: 0,
            buffer: vec![0; 65_536].into_boxed_slice(),
        })
    }

    /// The next datagram of the robot; none when all were taken. Others are dropped and counted.
    ///
    /// # Errors
    /// When the socket broke.
    pub fn receive(&mut self) -> io::Result<Option<&[u8]>> {
        loop {
            match self.socket.recv_from(&mut self.buffer) {
                Ok((length, from)) if from == self.robot => {
                    return Ok(Some(&self.buffer[..length]));
                }
                Ok(_) => self.strangers += 1,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(None),
                Err(error) if is_passing(&error) => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Send one datagram. What the network does not take now is lost, as on any radio.
    ///
    /// # Errors
    /// When the socket broke.
    pub fn send(&self, bytes: &[u8]) -> io::Result<()> {
        match self.socket.send_to(bytes, self.robot) {
            Ok(_) => Ok(()),
            Err(error)
                if rustix::io::Errno::from_io_error(&error) == Some(rustix::io::Errno::BADF) =>
            {
                Err(error)
            }
            // A full queue, a firewall, a network that is down: lost, as on any radio.
            Err(_) => Ok(()),
        }
    }

    /// Datagrams from another address than the robot's.
    #[must_use]
    pub const fn strangers(&self) -> u64 {
        self.strangers
    }
}

/// The robot is away, or a signal came: nothing is wrong with the socket.
fn is_passing(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::Interrupted
            | io::ErrorKind::ConnectionRefused
            | io::ErrorKind::HostUnreachable
            | io::ErrorKind::NetworkUnreachable
            | io::ErrorKind::NetworkDown
    )
}

impl AsFd for Transport {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn readable(transport: &Transport) {
        use rustix::event::{PollFd, PollFlags, Timespec, poll};
        let mut polled = [PollFd::new(transport, PollFlags::IN)];
        let timeout = Timespec {
            tv_sec: 10,
            tv_nsec: 0,
        };
        assert_eq!(
            poll(&mut polled, Some(&timeout)).unwrap(),
            1,
            "nothing came"
        );
    }

    #[test]
    fn a_datagram_from_a_stranger_is_dropped_and_counted() {
        let robot = UdpSocket::bind("127.0.0.1:0").unwrap();
        let stranger = UdpSocket::bind("127.0.0.1:0").unwrap();
        let mut transport = Transport::open(robot.local_addr().unwrap()).unwrap();
        let link = transport.socket.local_addr().unwrap();
        stranger.send_to(b"go left", link).unwrap();
        readable(&transport);
        assert_eq!(transport.receive().unwrap(), None);
        assert_eq!(transport.strangers(), 1);
        robot.send_to(b"hello", link).unwrap();
        readable(&transport);
        assert_eq!(transport.receive().unwrap(), Some(&b"hello"[..]));
    }
}
