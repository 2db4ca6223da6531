//! Serial line: a pseudo-terminal whose other end a host opens like a serial port.

use std::{
    io,
    os::fd::{AsFd, BorrowedFd, OwnedFd},
};

use rustix::{
    fs::{Mode, OFlags, fcntl_getfl, fcntl_setfl, open},
    io::{Errno, read, write},
    pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt},
    termios::{ControlModes, OptionalActions, Termios, tcgetattr, tcsetattr},
};

use super::{Source, Wire};

/// Speed that the robot sets. A host sets its own when it opens the line, which reveals the
/// opening.
const NOBODYS_BAUD: u32 = 50;

pub struct Pty {
    robot: OwnedFd,
    /// Host's end, held open: reading the robot's end fails while no process holds it.
    host: OwnedFd,
    /// Whether DTR falls when the host closes the line (HUPCL, set by the host), and so rises when
    /// the next host opens it.
    hangs_up: bool,
    opened: bool,
    path: String,
}

impl Pty {
    pub fn open() -> io::Result<Self> {
        let robot = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&robot)?;
        unlockpt(&robot)?;
        let path = ptsname(&robot, Vec::new())?;
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
        let host = open(path.as_c_str(), flags, Mode::empty())?;
        // Bytes pass unchanged: no echo, no line editing, no signals.
        let mut settings = tcgetattr(&host)?;
        settings.make_raw();
        settings.set_speed(NOBODYS_BAUD)?;
        tcsetattr(&host, OptionalActions::Now, &settings)?;
        fcntl_setfl(&robot, fcntl_getfl(&robot)? | OFlags::NONBLOCK)?;
        let path = path.to_string_lossy().into_owned();
        Ok(Self { robot, host, hangs_up: true, opened: false, path })
    }

    fn notice_host(&mut self) -> io::Result<()> {
        let mut settings: Termios = tcgetattr(&self.host)?;
        if settings.output_speed() != NOBODYS_BAUD {
            self.opened = self.hangs_up;
            self.hangs_up = settings.control_modes.contains(ControlModes::HUPCL);
            settings.set_speed(NOBODYS_BAUD)?;
            tcsetattr(&self.host, OptionalActions::Now, &settings)?;
        }
        Ok(())
    }
}

impl Wire for Pty {
    fn address(&self) -> String {
        self.path.clone()
    }

    fn readable(&self) -> Vec<BorrowedFd<'_>> {
        vec![self.robot.as_fd()]
    }

    fn connected(&mut self) -> io::Result<Option<Source>> {
        Ok(Some(Source::Line))
    }

    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<Option<(Source, usize)>> {
        match read(&self.robot, buffer) {
            Ok(0) | Err(Errno::AGAIN | Errno::INTR) => Ok(None),
            Ok(length) => {
                self.notice_host()?;
                Ok(Some((Source::Line, length)))
            }
            Err(error) => Err(error.into()),
        }
    }

    fn take_opened(&mut self) -> bool {
        std::mem::take(&mut self.opened)
    }

    /// Sends bytes. A slow host loses some; its decoder finds the next frame.
    fn send(&mut self, _: Source, bytes: &[u8]) -> io::Result<()> {
        write(&self.robot, bytes).map(drop).map_err(io::Error::from)
    }
}
