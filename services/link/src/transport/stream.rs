//! Connection or serial line that is reopened whenever it closes.
//!
//! Frames are sent whole, because a partial one corrupts the next. After a partial write the rest
//! goes first, and messages meanwhile are lost.
//!
//! A waiter needs a constant descriptor, so it gets an epoll one that follows the stream's.

use std::{
    fmt, io,
    os::fd::{AsFd, BorrowedFd, OwnedFd},
    time::Duration,
};

use common::{address::Address, poll};
use rustix::{
    event::epoll::{self, CreateFlags, EventData, EventFlags},
    io::{Errno, read, write},
};

use super::{
    Wire,
    counts::{Attempts, Tally},
};
use crate::backoff::{Backoff, has_passed};

/// Short, so that a robot that restarts its network is found at once.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
/// Longest wait for a robot that answers again.
const LONGEST_PAUSE: Duration = Duration::from_secs(2);
/// Time limit of an attempt, as a robot that is off stays silent.
const PATIENCE: Duration = Duration::from_secs(2);
/// Age of a connection that no other program cuts: two links take the robot from each other at
/// least every [`LONGEST_PAUSE`].
const STEADY: Duration = Duration::from_secs(10);

pub(super) trait Dial: fmt::Debug {
    /// Silence of a dead stream; none if the system reports that.
    const SILENCE: Option<Duration>;

    fn dial(&self) -> io::Result<OwnedFd>;

    /// Checks that a writable `descriptor` is connected.
    fn finish(&self, _descriptor: &OwnedFd) -> io::Result<()> {
        Ok(())
    }

    /// Discards unsent bytes, so that closing does not wait. The system closes connections in the
    /// background.
    fn abandon(&self, _descriptor: &OwnedFd) {}
}

#[derive(Debug)]
struct Connection {
    descriptor: OwnedFd,
    /// Otherwise it is being opened.
    is_open: bool,
    /// Start of the attempt, or when bytes last came.
    since_ns: u64,
    opened_ns: u64,
}

#[derive(Debug)]
pub(super) struct Stream<D> {
    dial: D,
    robot: Address,
    epoll: OwnedFd,
    connection: Option<Connection>,
    tail: Vec<u8>,
    backoff: Backoff,
    unsent: u64,
    cut: u64,
    /// Why the wire is down, which is not logged again.
    down: Option<Errno>,
}

impl<D: Dial + 'static> Stream<D> {
    pub(super) fn boxed(dial: D, robot: &Address) -> io::Result<Box<dyn Wire>> {
        Ok(Box::new(Self {
            dial,
            robot: robot.clone(),
            epoll: epoll::create(CreateFlags::CLOEXEC)?,
            connection: None,
            tail: Vec::new(),
            backoff: Backoff::new(FIRST_PAUSE, LONGEST_PAUSE),
            unsent: 0,
            cut: 0,
            down: None,
        }))
    }
}

impl<D: Dial> Wire for Stream<D> {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        Some(self.epoll.as_fd())
    }

    fn is_open(&self) -> bool {
        self.connection.as_ref().is_some_and(|it| it.is_open)
    }

    fn tally(&self) -> Tally {
        Tally { unsent: self.unsent, cut: self.cut, ..Tally::default() }
    }

    fn attempts(&self, now_ns: u64) -> Option<Attempts> {
        let next_ns = match &self.connection {
            Some(Connection { is_open: true, .. }) => return None,
            Some(_) => 0,
            None => self.backoff.wait_ns(now_ns),
        };
        let failed = self.down.map(|errno| (errno, remedy(errno)));
        Some(Attempts { made: self.backoff.attempts, next_ns, failed })
    }

    /// Continue or give up an attempt, or send the rest of a message.
    fn maintain(&mut self, now_ns: u64) -> io::Result<()> {
        if self.connection.is_none() {
            if !self.backoff.is_due(now_ns) {
                return Ok(());
            }
            self.backoff.attempted(now_ns);
            match self.dial.dial() {
                Ok(descriptor) => {
                    let events = EventFlags::IN | EventFlags::OUT;
                    epoll::add(&self.epoll, &descriptor, EventData::new_u64(0), events)?;
                    assert!(self.tail.is_empty());
                    self.connection = Some(Connection {
                        descriptor,
                        is_open: false,
                        since_ns: now_ns,
                        opened_ns: now_ns,
                    });
                }
                Err(error) => {
                    self.cut = 0;
                    self.log(&error);
                }
            }
        }
        let Some(connection) = &mut self.connection else {
            return Ok(());
        };
        let longest = if connection.is_open { D::SILENCE } else { Some(PATIENCE) };
        if !connection.is_open && poll::is_writable(&connection.descriptor, Duration::ZERO)? {
            match self.dial.finish(&connection.descriptor) {
                Ok(()) => {
                    connection.is_open = true;
                    connection.since_ns = now_ns;
                    connection.opened_ns = now_ns;
                    self.watch(EventFlags::IN)?;
                    tracing::info!(robot = %self.robot, "the wire is open");
                }
                Err(error) => self.close(&error),
            }
        } else if longest.is_some_and(|longest| has_passed(connection.since_ns, now_ns, longest)) {
            self.close(&Errno::TIMEDOUT.into());
        } else {
            self.flush()?;
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], now_ns: u64) -> io::Result<Option<usize>> {
        let Some(connection) = self.connection.as_mut().filter(|it| it.is_open) else {
            return Ok(None);
        };
        match read(&connection.descriptor, buffer) {
            Ok(0) => {
                // The robot has spoken since the last attempt.
                self.cut += u64::from(self.backoff.attempts == 0);
                self.close(&io::ErrorKind::UnexpectedEof.into());
            }
            Ok(length) => {
                connection.since_ns = now_ns;
                if has_passed(connection.opened_ns, now_ns, STEADY) {
                    self.cut = 0;
                }
                // Only received bytes reset the pauses. Otherwise a peer that closes each
                // connection would be called ten times a second.
                self.backoff.reset();
                self.down = None;
                return Ok(Some(length));
            }
            Err(Errno::AGAIN | Errno::INTR) => {}
            Err(error) => self.close(&error.into()),
        }
        Ok(None)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.flush()?;
        let free = self.connection.as_ref().filter(|it| it.is_open && self.tail.is_empty());
        let Some(Connection { descriptor, .. }) = free else {
            self.unsent += 1;
            return Ok(());
        };
        match write(descriptor, bytes) {
            Ok(sent) if sent == bytes.len() => {}
            Ok(sent) => {
                self.tail.extend_from_slice(&bytes[sent..]);
                self.watch(EventFlags::IN | EventFlags::OUT)?;
            }
            Err(Errno::AGAIN | Errno::INTR) => self.unsent += 1,
            Err(error) => {
                self.unsent += 1;
                self.close(&error.into());
            }
        }
        Ok(())
    }
}

impl<D: Dial> Stream<D> {
    fn flush(&mut self) -> io::Result<()> {
        let held = self.connection.as_ref().filter(|_| !self.tail.is_empty());
        let Some(Connection { descriptor, .. }) = held else {
            return Ok(());
        };
        match write(descriptor, &self.tail) {
            Ok(sent) => {
                self.tail.drain(..sent);
                if self.tail.is_empty() {
                    self.watch(EventFlags::IN)?;
                }
            }
            Err(Errno::AGAIN | Errno::INTR) => {}
            Err(error) => self.close(&error.into()),
        }
        Ok(())
    }

    fn watch(&self, events: EventFlags) -> io::Result<()> {
        if let Some(Connection { descriptor, .. }) = &self.connection {
            epoll::modify(&self.epoll, descriptor, EventData::new_u64(0), events)?;
        }
        Ok(())
    }

    /// Closes the stream, whose descriptor leaves the epoll one.
    fn close(&mut self, error: &io::Error) {
        self.log(error);
        if let Some(Connection { descriptor, is_open, .. }) = self.connection.take() {
            // What accepts no connection does not end one for another program.
            self.cut *= u64::from(is_open);
            self.dial.abandon(&descriptor);
        }
        self.tail.clear();
    }

    fn log(&mut self, error: &io::Error) {
        // The end of a stream has no error number; EPIPE stands for it.
        let errno = Errno::from_io_error(error).unwrap_or(Errno::PIPE);
        if self.down.replace(errno) != Some(errno) {
            let remedy = remedy(errno);
            tracing::warn!(robot = %self.robot, %error, "the wire is down; {remedy} (the link retries without end)");
        }
    }
}

const fn remedy(errno: Errno) -> &'static str {
    match errno {
        Errno::NOENT | Errno::NODEV | Errno::NXIO | Errno::IO => {
            "plug the adapter in, or correct robot.address"
        }
        Errno::ACCESS => {
            "add your user to the group of the device, often `dialout`, and log in again"
        }
        Errno::AGAIN => "end the other program that holds the line",
        Errno::NOTTY => "name a serial line in robot.address",
        _ => "switch the robot on, or correct robot.address",
    }
}
