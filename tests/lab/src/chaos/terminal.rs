//! A pseudo-terminal for a program that draws on one.

use std::{
    fs::File,
    io::{self, Read as _},
    os::{fd::OwnedFd, unix::fs::OpenOptionsExt as _},
};

use rustix::{
    fs::OFlags,
    pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt},
    termios::{Winsize, tcsetwinsize},
};

const SIZE: Winsize = Winsize { ws_row: 24, ws_col: 80, ws_xpixel: 0, ws_ypixel: 0 };

/// Both ends of a terminal: the first reads the text that a program writes to the second.
pub fn open() -> io::Result<(File, File)> {
    let reads: OwnedFd = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&reads)?;
    unlockpt(&reads)?;
    tcsetwinsize(&reads, SIZE)?;
    let name = ptsname(&reads, Vec::new())?;
    let name = name.to_str().map_err(io::Error::other)?;
    let mut draws = File::options();
    // The terminal must not become the controlling terminal of this process.
    draws.read(true).write(true);
    draws.custom_flags(OFlags::NOCTTY.bits().cast_signed());
    let draws = draws.open(name)?;
    Ok((reads.into(), draws))
}

/// Read and drop the program's output in a thread, until the program ends.
pub fn read_all(mut reads: File) {
    std::thread::spawn(move || {
        let mut some = [0; 4096];
        while reads.read(&mut some).is_ok_and(|count| count > 0) {}
    });
}
