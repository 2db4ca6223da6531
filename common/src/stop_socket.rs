//! Operator's stop without middleware: the datagram socket of the link, or of its stop guard, in
//! the robot's directory, which only the owner may enter. The stop works with a damaged bus, a full
//! disk, or a hung supervisor.
//!
//! A datagram is one byte: [`Request`] to the link, [`Answer`] from it.

use std::{
    fs, io,
    os::{
        fd::{AsFd, BorrowedFd},
        linux::net::SocketAddrExt as _,
        unix::{
            fs::{DirBuilderExt as _, MetadataExt as _, symlink},
            net::{SocketAddr, UnixDatagram},
        },
    },
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use serde::{Deserialize, Serialize};

use crate::{clock::monotonic_ns, domain::Domain, file, poll, samples::Rest};

/// Operator's request to the link: its byte. Recordings hold the number of the variant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u8)]
pub enum Request {
    Resume = b'r',
    /// The robot stands until an operator resumes.
    Stop = b's',
    /// Releases the stop guard: a person has seen the robot at rest, or it is off. A link ignores
    /// this.
    SignOff = b'x',
    /// Asks for the stop guard's observations. A link ignores this.
    Look = b'?',
}

impl Request {
    const ALL: [Self; 4] = [Self::Resume, Self::Stop, Self::SignOff, Self::Look];
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    Heard,
    AtRest,
    /// Stop guard's observations: [`Rest`] and the seconds without a motor frame.
    Sees(Rest, u8),
}

const HEARD: u8 = b'h';
const AT_REST: u8 = b'a';

/// Most operators that the link answers at once; it obeys others too.
const MOST_ASKING: usize = 16;

#[derive(Debug)]
pub struct StopSocket {
    path: PathBuf,
    socket: UnixDatagram,
    asking: Vec<SocketAddr>,
    /// Operators who wait for the stop guard's observations.
    looking: Vec<SocketAddr>,
}

impl StopSocket {
    /// Binds `path` in place of an earlier process's socket.
    pub fn bind(path: PathBuf) -> io::Result<Self> {
        file::remove(&path)?;
        Ok(Self { socket: bind(&path)?, path, asking: Vec::new(), looking: Vec::new() })
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
            // The robot drives on despite any fault of the socket.
            let (length, from) = self.socket.recv_from(&mut byte).ok()?;
            let known = Request::ALL.into_iter().find(|it| (length, byte) == (1, [*it as u8]));
            let Some(request) = known else { continue };
            self.answer(&from, &[HEARD]);
            let waiting = match request {
                Request::Stop => &mut self.asking,
                Request::Look => &mut self.looking,
                Request::Resume | Request::SignOff => return Some(request),
            };
            if waiting.len() < MOST_ASKING {
                waiting.push(from);
            }
            return Some(request);
        }
    }

    pub fn tell_at_rest(&mut self) {
        for operator in std::mem::take(&mut self.asking) {
            self.answer(&operator, &[AT_REST]);
        }
    }

    pub fn tell(&mut self, rest: Rest, silent_s: u8) {
        for operator in std::mem::take(&mut self.looking) {
            self.answer(&operator, &[rest as u8, silent_s]);
        }
    }

    fn answer(&self, operator: &SocketAddr, bytes: &[u8]) {
        // A departed operator needs no answer.
        let _ = self.socket.send_to_addr(bytes, operator);
    }
}

impl AsFd for StopSocket {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }
}

/// Binds a socket in a robot's directory, which it recreates if necessary; no call on it blocks.
pub fn bind(path: &Path) -> io::Result<UnixDatagram> {
    if let Some(directory) = path.parent() {
        make_directory(directory)?;
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
    /// Returns `None` if no process answers at `path`.
    pub fn connect(path: &Path) -> io::Result<Option<Self>> {
        // An abstract name leaves no file.
        let name = format!("firsthand-operator-{}-{}", std::process::id(), monotonic_ns());
        let socket = UnixDatagram::bind_addr(&SocketAddr::from_abstract_name(name)?)?;
        // The queue of a frozen process is full after a few requests.
        socket.set_nonblocking(true)?;
        match socket.connect(path) {
            Ok(()) => Ok(Some(Self { socket })),
            Err(error) => match error.kind() {
                io::ErrorKind::NotFound | io::ErrorKind::ConnectionRefused => Ok(None),
                _ => Err(error),
            },
        }
    }

    pub fn send(&self, request: Request) -> io::Result<()> {
        self.socket.send(&[request as u8]).map(drop)
    }

    pub fn is_heard(&self) -> bool {
        // A datagram without a byte is no request. A full queue has a reader.
        matches!(
            self.socket.send(&[]).map_err(|error| error.kind()),
            Ok(_) | Err(io::ErrorKind::WouldBlock)
        )
    }

    /// Waits up to `patience`. Fails if the link is gone.
    pub fn answer(&self, patience: Duration) -> io::Result<Option<Answer>> {
        let began = Instant::now();
        loop {
            if !poll::is_readable(&self.socket, patience.saturating_sub(began.elapsed()))? {
                return Ok(None);
            }
            let mut bytes = [0; 2];
            let length = self.socket.recv(&mut bytes)?;
            return Ok(Some(match (length, bytes) {
                (2, [rest, silent_s]) => Answer::Sees(Rest::from_byte(rest), silent_s),
                (1, [HEARD, _]) => Answer::Heard,
                (1, [AT_REST, _]) => Answer::AtRest,
                _ => continue,
            }));
        }
    }
}

/// Inode and creation time of a socket, which differ from its successor's; empty without a socket.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity(pub String);

impl Identity {
    pub fn now(socket: &Path) -> Self {
        let found = fs::symlink_metadata(socket);
        Self(found.map_or_else(
            |_| String::new(),
            |found| format!("{}-{}-{}", found.ino(), found.ctime(), found.ctime_nsec()),
        ))
    }

    pub fn is_succeeded(&self, socket: &Path) -> bool {
        Self::now(socket) != *self && matches!(Operator::connect(socket), Ok(Some(_)))
    }
}

/// Mark of an operator's stop in a run's directory, for a new link.
#[derive(Debug)]
pub struct StopMark(PathBuf);

impl StopMark {
    pub fn of(directory: &Path) -> Self {
        Self(directory.join("operator-stop"))
    }

    pub fn is_set(&self) -> bool {
        file::exists(&self.0)
    }

    pub fn set(&self, stopped: bool) -> io::Result<()> {
        if stopped { file::create(&self.0) } else { file::remove(&self.0) }
    }
}

/// Mark of a robot that may move. The link sets it before the first motion command. Whoever sees
/// the robot at rest, or signs it off, clears it. It outlives every process, so the next link or
/// guard knows.
#[derive(Debug)]
pub struct OwedStop(Domain);

impl OwedStop {
    pub const fn of(domain: Domain) -> Self {
        Self(domain)
    }

    pub fn is_set(&self) -> bool {
        file::exists(&self.0.owed_stop())
    }

    pub fn set(&self, owed: bool, directory: &Path) -> io::Result<()> {
        if !owed {
            return file::remove(&self.0.owed_stop());
        }
        if self.is_set() {
            return Ok(());
        }
        if crate::machine::is_simulated() {
            return file::create(&self.0.owed_stop());
        }
        make_directory(self.0.directory())?;
        symlink(directory, self.0.owed_stop())
    }
}

fn make_directory(directory: &Path) -> io::Result<()> {
    fs::DirBuilder::new().recursive(true).mode(0o700).create(directory)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ask(guard: &mut StopSocket, path: &Path, request: Request) -> Operator {
        let operator = Operator::connect(path).unwrap().unwrap();
        operator.send(request).unwrap();
        assert_eq!(guard.take(), Some(request));
        assert_eq!(operator.answer(Duration::ZERO).unwrap(), Some(Answer::Heard));
        operator
    }

    #[test]
    fn a_link_whose_socket_and_directory_were_removed_is_reached_when_it_has_looked_again() {
        let domain = Domain::of(format!("stop-{}", std::process::id()).parse().unwrap());
        let mut link = StopSocket::bind(domain.stop_socket()).unwrap();
        for _ in 0..2 {
            fs::remove_dir_all(domain.directory()).unwrap();
            assert_eq!(link.take(), None);
            ask(&mut link, &domain.stop_socket(), Request::Stop);
        }
        fs::remove_dir_all(domain.directory()).unwrap();
    }

    #[test]
    fn operators_who_look_take_no_place_from_one_who_waits_for_rest() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("guard");
        let mut guard = StopSocket::bind(path.clone()).unwrap();
        for _ in 0..=MOST_ASKING {
            let looks = ask(&mut guard, &path, Request::Look);
            guard.tell(Rest::Moving, 1);
            assert_eq!(looks.answer(Duration::ZERO).unwrap(), Some(Answer::Sees(Rest::Moving, 1)));
        }
        let stops = ask(&mut guard, &path, Request::Stop);
        guard.tell_at_rest();
        assert_eq!(stops.answer(Duration::ZERO).unwrap(), Some(Answer::AtRest));
    }
}
