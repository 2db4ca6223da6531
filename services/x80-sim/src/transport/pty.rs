//! A serial line: a pseudo-terminal whose other end a host opens like a serial port.

use std::{
    io,
    os::fd::{AsFd, BorrowedFd, OwnedFd},
};

use rustix::{
    fs::{Mode, OFlags, fcntl_getfl, fcntl_setfl, open},
    io::{Errno, read, write},
    pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt},
    termios::{OptionalActions, tcgetattr, tcsetattr},
};

use super::source::Source;

#[derive(Debug)]
pub(crate) struct Pty {
    robot: OwnedFd,
    /// The host's end is held open: while nobody holds it, reading the robot's end is an error.
    _host: OwnedFd,
    path: String,
}

impl Pty {
    pub(super) fn open() -> io::Result<Self> {
        let robot = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&robot)?;
        unlockpt(&robot)?;
        let path = ptsname(&robot, Vec::new())?;
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
        let host = open(path.as_c_str(), flags, Mode::empty())?;
        // Bytes pass as they are: no echo, no line editing, no signals.
        let mut settings = tcgetattr(&host)?;
        settings.make_raw();
        tcsetattr(&host, OptionalActions::Now, &settings)?;
        fcntl_setfl(&robot, fcntl_getfl(&robot)? | OFlags::NONBLOCK)?;
        Ok(Self { robot, _host: host, path: path.to_string_lossy().into_owned() })
    }

    pub(super) fn path(&self) -> &str {
        &self.path
    }

    pub(super) fn readable(&self) -> BorrowedFd<'_> {
        self.robot.as_fd()
    }

    pub(super) fn receive(&self, buffer: &mut [u8]) -> io::Result<Option<(Source, usize)>> {
        match read(&self.robot, buffer) {
            Ok(0) | Err(Errno::AGAIN | Errno::INTR) => Ok(None),
            Ok(length) => Ok(Some((Source::Line, length))),
            Err(error) => Err(error.into()),
        }
    }

    /// Bytes that a host does not read in time are lost; its decoder finds the next frame.
    pub(super) fn send(&self, bytes: &[u8]) -> io::Result<()> {
        write(&self.robot, bytes).map(drop).map_err(io::Error::from)
    }
}
