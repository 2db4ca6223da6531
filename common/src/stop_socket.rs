//! The operator's stop without middleware: a datagram socket of the link in the robot's directory, which only its owner may
//! enter. It works when the files of the bus are damaged, the disk is full, or the supervisor stands still.
//!
//! A datagram is one byte: [`Request`] to the link, [`Answer`] from it.

use std::{
    fs, io,
    os::{
        fd::{AsFd, BorrowedFd},
        linux::net::SocketAddrExt as _,
        unix::{
            fs::MetadataExt as _,
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
    /// The stop is over.
    Resume,
    /// The robot stands until an operator resumes.
    Stop,
}

/// An answer of the link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// The link obeys.
    Heard,
    /// The encoders say that the robot rests.
    AtRest,
}

const STOP: u8 = b's';
const RESUME: u8 = b'r';
const HEARD: u8 = b'h';
const AT_REST: u8 = b'a';

/// The most operators that the link answers at once; it obeys the requests of further ones, too.
const MOST_ASKING: usize = 16;

/// The link's end of the socket.
#[derive(Debug)]
pub struct StopSocket {
    socket: UnixDatagram,
    asking: Vec<SocketAddr>,
}

impl StopSocket {
    /// The socket of the robot of `domain`, in the place of that of an earlier link.
    pub fn bind(domain: &Domain) -> io::Result<Self> {
        let path = domain.stop_socket();
        remove(&path)?;
        let socket = UnixDatagram::bind(&path)?;
        socket.set_nonblocking(true)?;
        Ok(Self { socket, asking: Vec::new() })
    }

    /// The next request; none when all were taken.
    pub fn take(&mut self) -> Option<Request> {
        let mut byte = [0];
        loop {
            // Whatever is wrong with the socket, the robot drives on as it was ordered.
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

    /// Tell those who asked for a stop that the robot rests.
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

/// The operator's end of the socket.
#[derive(Debug)]
pub struct Operator {
    socket: UnixDatagram,
}

impl Operator {
    /// A connection to the link of the robot of `domain`; none if no link runs.
    pub fn connect(domain: &Domain) -> io::Result<Option<Self>> {
        // An abstract name leaves no file behind.
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

    /// Send `request`.
    pub fn send(&self, request: Request) -> io::Result<()> {
        let byte = match request {
            Request::Stop => STOP,
            Request::Resume => RESUME,
        };
        self.socket.send(&[byte]).map(drop)
    }

    /// The next answer within `patience`.
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

/// Tells the socket of one link from that of its successor: inode and time of its creation. Empty for a link without one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity(pub String);

impl Identity {
    /// The identity of the socket in the robot's directory now.
    pub fn now(domain: &Domain) -> Self {
        let found = fs::symlink_metadata(domain.stop_socket());
        Self(found.map_or_else(
            |_| String::new(),
            |found| format!("{}-{}-{}", found.ino(), found.ctime(), found.ctime_nsec()),
        ))
    }

    /// Whether a link runs whose socket is not this one.
    pub fn is_succeeded(&self, domain: &Domain) -> bool {
        Self::now(domain) != *self && matches!(Operator::connect(domain), Ok(Some(_)))
    }
}

/// A mark in a run's directory that an operator's stop holds, so that a link that is started again obeys it, too.
#[derive(Debug)]
pub struct StopMark {
    path: PathBuf,
}

impl StopMark {
    /// The mark of the run in `directory`.
    #[must_use]
    pub fn of(directory: &Path) -> Self {
        Self { path: directory.join("operator-stop") }
    }

    /// Whether the mark is there.
    #[must_use]
    pub fn is_set(&self) -> bool {
        self.path.exists()
    }

    /// Set or remove the mark.
    pub fn set(&self, stopped: bool) -> io::Result<()> {
        if stopped {
            return fs::File::create(&self.path).map(drop);
        }
        remove(&self.path)
    }
}

/// Remove a file, if it exists.
fn remove(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}
