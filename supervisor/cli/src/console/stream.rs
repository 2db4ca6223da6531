//! Standard output of a command that goes on until it is told to end: by a signal, or by its reader, who has read enough.

use std::{
    io::{self, Write as _},
    time::Duration,
};

use common::{
    poll,
    signals::{SIGHUP, SIGINT, SIGTERM, Signals},
};

use super::output::unless_closed;

/// So much goes into a pipe that is writable without waiting for its reader (pipe(7)).
const CHUNK: usize = 4096;
/// How often a command that waits looks whether it is told to end.
pub(crate) const LOOK_EVERY: Duration = Duration::from_millis(100);

/// Niceness of a command that watches.
const NICE: i32 = 5;

/// Stages that answer the robot get the processor before this process.
pub(crate) fn let_stages_go_first() {
    // Where that is refused they share it.
    let _ = rustix::process::nice(NICE);
}

/// Standard output, and the signals that end the command.
pub(crate) struct Stream {
    signals: Signals,
    ended: bool,
}

impl Stream {
    /// From now on signals end the command in order, so that it leaves the bus before it ends, and stages go first.
    pub(crate) fn open() -> io::Result<Self> {
        let_stages_go_first();
        Ok(Self {
            signals: Signals::catch(&[SIGINT, SIGTERM, SIGHUP])?,
            ended: false,
        })
    }

    /// Whether the command is told to end.
    pub(crate) fn has_ended(&mut self) -> bool {
        self.ended |= self.signals.came() || poll::is_closed(io::stdout()).unwrap_or(true);
        self.ended
    }

    /// Write `text`, as far as a reader takes it before the command is told to end.
    pub(crate) fn write(&mut self, text: &str) -> io::Result<()> {
        let mut stdout = io::stdout();
        for chunk in text.as_bytes().chunks(CHUNK) {
            loop {
                if self.has_ended() {
                    return Ok(());
                }
                if poll::is_writable(&stdout, LOOK_EVERY)? {
                    break;
                }
            }
            unless_closed(stdout.write_all(chunk).and_then(|()| stdout.flush()))?;
        }
        Ok(())
    }
}
