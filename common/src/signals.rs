//! Signals as a readable descriptor, so that none is lost between checking and waiting.

use std::{
    ffi::c_int,
    io::{self, Read},
    os::{
        fd::{AsFd, BorrowedFd},
        unix::net::UnixStream,
    },
    time::Duration,
};

use nix::sys::signal::{SigSet, SigmaskHow};
pub use signal_hook::consts::{SIGCONT, SIGHUP, SIGINT, SIGTERM};

use crate::{poll, process_status};

#[derive(Debug)]
pub struct Signals {
    pipe: UnixStream,
}

impl Signals {
    /// Catches `signals`, except an already ignored SIGHUP, as under `nohup`.
    pub fn catch(signals: &[c_int]) -> io::Result<Self> {
        let (pipe, written_by_handler) = UnixStream::pair()?;
        pipe.set_nonblocking(true)?;
        // A signal between its handler's installation and the registration of what the handler does would be lost: it waits instead.
        let before = SigSet::all().thread_swap_mask(SigmaskHow::SIG_BLOCK)?;
        let registered = Self::register(signals, &written_by_handler);
        before.thread_set_mask()?;
        registered.map(|()| Self { pipe })
    }

    fn register(signals: &[c_int], written_by_handler: &UnixStream) -> io::Result<()> {
        for &signal in signals {
            if signal == SIGHUP && is_ignored(SIGHUP) {
                continue;
            }
            signal_hook::low_level::pipe::register(signal, written_by_handler.try_clone()?)?;
        }
        Ok(())
    }

    pub fn that_end() -> io::Result<Self> {
        Self::catch(&[SIGINT, SIGTERM, SIGHUP])
    }

    pub fn pending(&self) -> bool {
        poll::is_readable(self, Duration::ZERO).unwrap_or(true)
    }

    pub fn came(&mut self) -> bool {
        matches!(self.pipe.read(&mut [0; 16]), Ok(read) if read > 0)
    }

    pub fn wait(&mut self) -> io::Result<()> {
        while !self.came() {
            poll::readable(&[self.as_fd()], None)?;
        }
        Ok(())
    }
}

fn is_ignored(signal: c_int) -> bool {
    let mask = process_status::field("self/status", "SigIgn")
        .and_then(|mask| u64::from_str_radix(&mask, 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

impl AsFd for Signals {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.pipe.as_fd()
    }
}

/// Exits without waiting for other threads.
pub fn exit_at_once(code: u8) -> ! {
    signal_hook::low_level::exit(code.into())
}
