//! The subcommands: one file each.

use std::io::{self, Write as _};

#[cfg(feature = "tools")]
pub(crate) mod chaos;
pub(crate) mod check;
#[cfg(feature = "tools")]
pub(crate) mod command_line;
#[cfg(feature = "tools")]
pub(crate) mod consumer;
mod directories;
pub(crate) mod echo;
pub(crate) mod error_code;
#[cfg(feature = "tools")]
pub(crate) mod evaluate;
#[cfg(feature = "tools")]
pub(crate) mod experiments;
pub(crate) mod fault;
#[cfg(feature = "tools")]
pub(crate) mod field;
pub(crate) mod help;
pub(crate) mod hz;
pub(crate) mod install;
#[cfg(feature = "tools")]
pub(crate) mod latency;
pub(crate) mod list;
pub(crate) mod logs;
#[cfg(feature = "tools")]
mod mission_progress;
pub(crate) mod missions;
pub(crate) mod operate;
pub(crate) mod other_user;
mod python;
pub(crate) mod record;
#[cfg(feature = "tools")]
pub(crate) mod replay;
#[cfg(feature = "tools")]
pub(crate) mod report;
pub(crate) mod run;
mod run_recorder;
pub(crate) mod runs;
#[cfg(feature = "simulator")]
pub(crate) mod sim;
pub(crate) mod stage;
pub(crate) mod status;
mod stream;
pub(crate) mod tables;
#[cfg(feature = "tools")]
pub(crate) mod top;

/// What a subcommand fails with: one clear sentence.
type Failure = Box<dyn std::error::Error>;

/// Write `text` to standard output, at once. A reader that went away has read enough (`firsthand help tables | head`).
fn print_text(text: &str) -> io::Result<()> {
    let mut stdout = io::stdout();
    unless_closed(
        stdout
            .write_all(text.as_bytes())
            .and_then(|()| stdout.flush()),
    )
}

/// A pipe whose reader has ended, or a terminal that was closed, is no failure.
fn unless_closed(written: io::Result<()>) -> io::Result<()> {
    match written {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        Err(error) if error.raw_os_error() == Some(CLOSED_TERMINAL) => Ok(()),
        written => written,
    }
}

/// What the kernel answers who writes to a terminal that was closed.
const CLOSED_TERMINAL: i32 = rustix::io::Errno::IO.raw_os_error();

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reader_that_went_away_is_no_failure() {
        assert!(unless_closed(Err(io::ErrorKind::BrokenPipe.into())).is_ok());
        assert!(unless_closed(Err(io::Error::from_raw_os_error(CLOSED_TERMINAL))).is_ok());
        assert!(unless_closed(Err(io::ErrorKind::StorageFull.into())).is_err());
    }
}
