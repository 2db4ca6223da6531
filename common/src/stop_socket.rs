//! The operator's stop without middleware: the link's datagram socket in the robot's directory, which only its owner may enter. It works
//! with a damaged bus, a full disk, or a supervisor that hangs.
//!
//! A datagram is one byte: [`Request`] to the link, [`Answer`] from it.

use std::{
    fs, io,
    os::{
        fd::{AsFd, BorrowedFd},
        linux::net::SocketAddrExt as _,
        unix::{
            fs::{DirBuilderExt as _, MetadataExt as _},
            net::{SocketAddr, UnixDatagram},
        },
    },
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use serde::{Deserialize, Serialize};

use crate::{clock::monotonic_ns, domain::Domain, poll};

/// A request of an operator to the link. Recordings hold the number of the variant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Request {
    Resume,
    /// The robot stands until an operator resumes.
    Stop,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    Heard,
    AtRest,
}

const STOP: u8 = b's';
const RESUME: u8 = b'r';
const HEARD: u8 = b'h';
const AT_REST: u8 = b'a';

/// The most operators that the link answers at once; it obeys others too.
const MOST_ASKING: usize = 16;

#[derive(Debug)]
pub struct StopSocket {
    path: PathBuf,
    socket: UnixDatagram,
    asking: Vec<SocketAddr>,
}

impl StopSocket {
    /// Bind the robot's socket in place of an earlier link's. Fails when the system refuses.
    pub fn bind(domain: &Domain) -> io::Result<Self> {
        let path = domain.stop_socket();
        remove(&path)?;
        Ok(Self { socket: bind(&path)?, path, asking: Vec::new() })
    }

    pub fn take(&mut self) -> Option<Request> {
        let mut byte = [0];
        // A cleaner of temporary files may remove it while the robot drives.
        if !self.path.exists()
            && let Ok(again) = bind(&self.path)
        {
            self.socket = again;
        }
        loop {
            // Whatever is wrong with the socket, the robot drives on as ordered.
            let (length, from) = self.socket.recv_from(&mut byte).ok()?;
            let request = match (length, byte) {
                (1, [STOP]) => Request::Stop,
                (1, [RESUME]) => Request::Resume,
                _ => continue,
            };
            self.answer(&from, HEARD);
            if request == Request::Stop && self.asking.len() < MOST_ASKING {
                self.asking.push(from);
            }
            return Some(request);
        }
    }

    pub fn tell_at_rest(&mut self) {
        for operator in std::mem::take(&mut self.asking) {
            self.answer(&operator, AT_REST);
        }
    }

    fn answer(&self, operator: &SocketAddr, byte: u8) {
        // An operator who has gone needs no answer.
        let _ = self.socket.send_to_addr(&[byte], operator);
    }
}

impl AsFd for StopSocket {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }
}

/// Bind a socket at `path`, and make its directory, if that was removed.
fn bind(path: &Path) -> io::Result<UnixDatagram> {
    if let Some(directory) = path.parent() {
        fs::DirBuilder::new().recursive(true).mode(0o700).create(directory)?;
    }
    let socket = UnixDatagram::bind(path)?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}

#[derive(Debug)]
pub struct Operator {
    socket: UnixDatagram,
}

impl Operator {
    /// None if no link runs. Fails when the system refuses a socket.
    pub fn connect(domain: &Domain) -> io::Result<Option<Self>> {
        // An abstract name leaves no file.
        let name = format!("firsthand-operator-{}-{}", std::process::id(), monotonic_ns());
        let socket = UnixDatagram::bind_addr(&SocketAddr::from_abstract_name(name)?)?;
        match socket.connect(domain.stop_socket()) {
            Ok(()) => Ok(Some(Self { socket })),
            Err(error) => match error.kind() {
                io::ErrorKind::NotFound | io::ErrorKind::ConnectionRefused => Ok(None),
                _ => Err(error),
            },
        }
    }

    pub fn send(&self, request: Request) -> io::Result<()> {
        let byte = match request {
            Request::Stop => STOP,
            Request::Resume => RESUME,
        };
        self.socket.send(&[byte]).map(drop)
    }

    /// Waits up to `patience`. Fails when the link is gone.
    pub fn answer(&self, patience: Duration) -> io::Result<Option<Answer>> {
        let began = Instant::now();
        loop {
            let left = patience.saturating_sub(began.elapsed());
            if !poll::is_readable(&self.socket, left)? {
                return Ok(None);
            }
            let mut byte = [0];
            let length = self.socket.recv(&mut byte)?;
            match (length, byte) {
                (1, [HEARD]) => return Ok(Some(Answer::Heard)),
                (1, [AT_REST]) => return Ok(Some(Answer::AtRest)),
                _ => {}
            }
        }
    }
}

/// Inode and creation time of a link's socket tell it from its successor's; empty without a link.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity(pub String);

impl Identity {
    pub fn now(domain: &Domain) -> Self {
        let found = fs::symlink_metadata(domain.stop_socket());
        Self(found.map_or_else(
            |_| String::new(),
            |found| format!("{}-{}-{}", found.ino(), found.ctime(), found.ctime_nsec()),
        ))
    }

    pub fn is_succeeded(&self, domain: &Domain) -> bool {
        Self::now(domain) != *self && matches!(Operator::connect(domain), Ok(Some(_)))
    }
}

/// An operator's stop leaves this mark in a run's directory, so that a new link obeys it too.
#[derive(Debug)]
pub struct StopMark {
    path: PathBuf,
}

impl StopMark {
    pub fn of(directory: &Path) -> Self {
        Self { path: directory.join("operator-stop") }
    }

    pub fn is_set(&self) -> bool {
        self.path.exists()
    }

    pub fn set(&self, stopped: bool) -> io::Result<()> {
        if stopped {
            return fs::File::create(&self.path).map(drop);
        }
        remove(&self.path)
    }
}

fn remove(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_whose_socket_and_directory_were_removed_is_reached_when_it_has_looked_again() {
        let domain = Domain::of(format!("stop-{}", std::process::id()).parse().unwrap());
        let mut link = StopSocket::bind(&domain).unwrap();
        for _ in 0..2 {
            fs::remove_dir_all(domain.directory()).unwrap();
            assert_eq!(link.take(), None);
            let operator = Operator::connect(&domain).unwrap().unwrap();
            operator.send(Request::Stop).unwrap();
            assert_eq!(link.take(), Some(Request::Stop));
            assert_eq!(operator.answer(Duration::ZERO).unwrap(), Some(Answer::Heard));
        }
        fs::remove_dir_all(domain.directory()).unwrap();
    }
}
