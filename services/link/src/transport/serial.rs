//! Serial line: 8 data bits, no parity, 1 stop bit, no translation.
//!
//! rustix opens it, because the waiter needs a `BorrowedFd`, which `serialport` gives only by
//! `unsafe`. Lowering DTR needs `unsafe`, because rustix lacks that request.

#![allow(unsafe_code)]

use std::{io, os::fd::OwnedFd, path::PathBuf, time::Duration};

use rustix::{
    fs::{FlockOperation, Mode, OFlags, flock, open},
    io::Errno,
    ioctl::{Opcode, Setter, ioctl},
    termios::{
        ControlModes, OptionalActions, QueueSelector, SpecialCodeIndex, isatty, tcflush, tcgetattr,
        tcsetattr,
    },
};

use super::{Line, stream::Dial};

#[derive(Debug)]
pub(super) struct Serial {
    pub path: PathBuf,
    pub line: Line,
}

/// Lowers DTR, if the line has it; pseudo-terminals do not.
fn lower_dtr(line: &OwnedFd) {
    const TIOCMBIC: Opcode = 0x5417;
    const TIOCM_DTR: i32 = 0x002;
    // SAFETY: Linux reads an `int` for this request, by the header `asm-generic/termios.h`, and
    // writes nothing.
    let lowered = unsafe { ioctl(line, Setter::<TIOCMBIC, _>::new(TIOCM_DTR)) };
    if let Err(error) = lowered {
        tracing::debug!(%error, "cannot lower DTR, so it stays unchanged");
    }
}

impl Dial for Serial {
    /// Silence is fine: the system reports an unplugged adapter.
    const SILENCE: Option<Duration> = None;

    fn dial(&self) -> io::Result<OwnedFd> {
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let line = open(&self.path, flags, Mode::empty())?;
        if !isatty(&line) {
            return Err(Errno::NOTTY.into());
        }
        // The lock ends with this process. TIOCEXCL would outlast a killed one while any process
        // holds the line, and refuse the successor.
        flock(&line, FlockOperation::NonBlockingLockExclusive)?;
        let mut settings = tcgetattr(&line)?;
        settings.make_raw();
        settings.set_speed(self.line.baud)?;
        let flow = ControlModes::CSIZE
            | ControlModes::PARENB
            | ControlModes::CSTOPB
            | ControlModes::CRTSCTS;
        // An Arduino restarts when DTR rises. Without HUPCL it stays high after this process, so
        // the stop guard and the next link do not restart the board.
        settings.control_modes.remove(flow | ControlModes::HUPCL);
        // CLOCAL ignores modem lines: three wires suffice.
        let eight = ControlModes::CS8 | ControlModes::CLOCAL | ControlModes::CREAD;
        settings.control_modes.insert(eight);
        // An empty read fails with EAGAIN; with VMIN = 0 it would return 0, the end of the line.
        settings.special_codes[SpecialCodeIndex::VMIN] = 1;
        settings.special_codes[SpecialCodeIndex::VTIME] = 0;
        tcsetattr(&line, OptionalActions::Now, &settings)?;
        if self.line.lowers_dtr {
            lower_dtr(&line);
        }
        // Bytes for an earlier holder are outdated.
        tcflush(&line, QueueSelector::IOFlush)?;
        Ok(line)
    }

    fn abandon(&self, line: &OwnedFd) {
        // An error means that the line is gone.
        let _ = tcflush(line, QueueSelector::IOFlush);
    }
}
