//! A serial line: 115200 baud, 8 data bits, no parity, 1 stop bit, bytes as they are.
//!
//! By rustix and not by the `serialport` crate: what that opens gives no `BorrowedFd`, and a waiter needs
//! one; making it out of the raw number would be `unsafe`.

use std::{
    fmt, io,
    os::fd::OwnedFd,
    path::{Path, PathBuf},
    time::Duration,
};

use rustix::{
    fs::{FlockOperation, Mode, OFlags, flock, open},
    io::Errno,
    termios::{
        ControlModes, OptionalActions, QueueSelector, SpecialCodeIndex, isatty, tcflush, tcgetattr,
        tcsetattr,
    },
};

use super::stream::Dial;

/// Speed of the line, bits a second.
const BAUD: u32 = 115_200;

/// The path of the line.
#[derive(Debug)]
pub(super) struct Serial {
    path: PathBuf,
}

impl Serial {
    pub(super) fn on(path: &Path) -> Self {
        Self { path: path.to_owned() }
    }
}

impl fmt::Display for Serial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "serial://{}", self.path.display())
    }
}

impl Dial for Serial {
    /// An adapter that is pulled out is an error of the line, and a quiet line has nothing to open anew.
    const SILENCE: Option<Duration> = None;

    fn dial(&self) -> io::Result<OwnedFd> {
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let line = open(&self.path, flags, Mode::empty())?;
        if !isatty(&line) {
            return Err(Errno::NOTTY.into());
        }
        // The lock reserves the line for this process. TIOCEXCL would do so, too, but it outlives a killed link for as long as
        // anyone has the line open, and shuts its successor out; this lock ends with its holder.
        flock(&line, FlockOperation::NonBlockingLockExclusive)?;
        let mut settings = tcgetattr(&line)?;
        settings.make_raw();
        settings.set_speed(BAUD)?;
        let flow = ControlModes::CSIZE
            | ControlModes::PARENB
            | ControlModes::CSTOPB
            | ControlModes::CRTSCTS;
        settings.control_modes.remove(flow);
        // CLOCAL: three wires are enough, nobody dials in.
        let eight = ControlModes::CS8 | ControlModes::CLOCAL | ControlModes::CREAD;
        settings.control_modes.insert(eight);
        // With no byte there, a read says so instead of saying that the line has ended.
        settings.special_codes[SpecialCodeIndex::VMIN] = 1;
        settings.special_codes[SpecialCodeIndex::VTIME] = 0;
        tcsetattr(&line, OptionalActions::Now, &settings)?;
        // Bytes for an earlier holder of the line are old.
        tcflush(&line, QueueSelector::IOFlush)?;
        Ok(line)
    }

    fn finish(&self, _: &OwnedFd) -> io::Result<()> {
        Ok(())
    }

    fn abandon(&self, line: &OwnedFd) {
        // A line that is gone has nothing to discard.
        let _ = tcflush(line, QueueSelector::IOFlush);
    }
}
