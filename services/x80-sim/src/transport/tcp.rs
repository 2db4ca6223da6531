//! TCP connection to the newest host.

use std::{
    io::{self, ErrorKind, Read, Write},
    net::{SocketAddr, TcpListener, TcpStream},
    os::fd::{AsFd, BorrowedFd},
};

use super::{Source, Wire};

pub struct Tcp {
    listener: TcpListener,
    address: SocketAddr,
    connection: Option<TcpStream>,
    /// Number of connections so far; the newest is open.
    accepted: u64,
    /// Whether [`Tcp::take_opened`] has yet to return the newest connection.
    opened: bool,
}

impl Tcp {
    pub fn bind(address: SocketAddr) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        Ok(Self {
            address: listener.local_addr()?,
            listener,
            connection: None,
            accepted: 0,
            opened: false,
        })
    }

    fn accept(&mut self) -> io::Result<()> {
        match self.listener.accept() {
            Ok((connection, _)) => {
                connection.set_nonblocking(true)?;
                connection.set_nodelay(true)?;
                self.accepted += 1;
                self.opened = true;
                self.connection = Some(connection);
                Ok(())
            }
            Err(error) if is_passing(&error) || error.kind() == ErrorKind::ConnectionAborted => {
                Ok(())
            }
            Err(error) => Err(error),
        }
    }
}

fn is_passing(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

impl Wire for Tcp {
    fn address(&self) -> String {
        self.address.to_string()
    }

    fn readable(&self) -> Vec<BorrowedFd<'_>> {
        let mut both = vec![self.listener.as_fd()];
        both.extend(self.connection.as_ref().map(AsFd::as_fd));
        both
    }

    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<Option<(Source, usize)>> {
        self.accept()?;
        let Some(connection) = &mut self.connection else {
            return Ok(None);
        };
        match connection.read(buffer) {
            Ok(length @ 1..) => return Ok(Some((Source::Connection(self.accepted), length))),
            Err(error) if is_passing(&error) => {}
            // The robot outlives a vanished host.
            Ok(0) | Err(_) => self.connection = None,
        }
        Ok(None)
    }

    fn take_opened(&mut self) -> bool {
        std::mem::take(&mut self.opened)
    }

    fn connected(&mut self) -> io::Result<Option<Source>> {
        self.accept()?;
        let open = self.connection.as_ref();
        Ok(open.map(|_| Source::Connection(self.accepted)))
    }

    /// Sends bytes, and closes the connection if the host does not read: half a frame would garble
    /// all later ones.
    fn send(&mut self, to: Source, bytes: &[u8]) -> io::Result<()> {
        let is_newest = to == Source::Connection(self.accepted);
        let Some(connection) = self.connection.as_mut().filter(|_| is_newest) else {
            return Err(ErrorKind::NotConnected.into());
        };
        let sent = connection.write_all(bytes);
        if sent.is_err() {
            self.connection = None;
        }
        sent
    }
}
