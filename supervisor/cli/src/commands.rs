//! The subcommands: one file each.

use std::io::{self, Write as _};

#[cfg(feature = "tools")]
pub(crate) mod chaos;
pub(crate) mod check;
mod directories;
#[cfg(feature = "tools")]
pub(crate) mod evaluate;
#[cfg(feature = "tools")]
pub(crate) mod experiments;
pub(crate) mod fault;
#[cfg(feature = "tools")]
pub(crate) mod field;
pub(crate) mod help;
pub(crate) mod install;
#[cfg(feature = "tools")]
pub(crate) mod latency;
#[cfg(feature = "tools")]
mod mission_progress;
pub(crate) mod missions;
pub(crate) mod operate;
#[cfg(feature = "tools")]
mod python;
pub(crate) mod replay_log;
pub(crate) mod run;
#[cfg(feature = "simulator")]
pub(crate) mod sim;
pub(crate) mod stage;
pub(crate) mod status;
pub(crate) mod tables;

/// What a subcommand fails with: one clear sentence.
type Failure = Box<dyn std::error::Error>;

/// Write `text` to standard output. A reader that went away has read enough (`firsthand help tables | head`).
fn print_text(text: &str) -> io::Result<()> {
    unless_closed(io::stdout().write_all(text.as_bytes()))
}

fn unless_closed(written: io::Result<()>) -> io::Result<()> {
    match written {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reader_that_went_away_is_no_failure() {
        assert!(unless_closed(Err(io::ErrorKind::BrokenPipe.into())).is_ok());
        assert!(unless_closed(Err(io::ErrorKind::StorageFull.into())).is_err());
    }
}
