//! Signals as something to wait for: a descriptor that becomes readable, so that none is ever missed
//! between looking and waiting.

use std::{
    ffi::c_int,
    io::{self, Read},
    os::{
        fd::{AsFd, BorrowedFd},
        unix::net::UnixStream,
    },
};

pub use signal_hook::consts::{SIGCONT, SIGHUP, SIGINT, SIGTERM};

use crate::process_status;

/// Signals caught by this process.
#[derive(Debug)]
pub struct Signals {
    pipe: UnixStream,
}

impl Signals {
    /// Catch `signals` from now on. SIGHUP stays ignored where whoever started the process
    /// had it ignored, as `nohup` does.
    pub fn catch(signals: &[c_int]) -> io::Result<Self> {
        let (pipe, written_by_handler) = UnixStream::pair()?;
        pipe.set_nonblocking(true)?;
        for &signal in signals {
            if signal == SIGHUP && is_ignored(SIGHUP) {
                continue;
            }
            signal_hook::low_level::pipe::register(signal, written_by_handler.try_clone()?)?;
        }
        Ok(Self { pipe })
    }

    /// Whether a signal came since the last call.
    pub fn came(&mut self) -> bool {
        matches!(self.pipe.read(&mut [0; 16]), Ok(read) if read > 0)
    }
}

/// Whether whoever started this process had it ignore `signal`.
fn is_ignored(signal: c_int) -> bool {
    let mask = process_status::field("self", "SigIgn")
        .and_then(|mask| u64::from_str_radix(&mask, 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

impl AsFd for Signals {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.pipe.as_fd()
    }
}

/// End this process at once, whatever its other threads wait for.
pub fn exit_at_once(code: u8) -> ! {
    signal_hook::low_level::exit(code.into())
}
