//! Standard output until a signal or a closed reader.

use std::{
    io::{self, Write as _},
    time::Duration,
};

use common::{poll, signals::Signals};

use super::output::unless_closed;

/// Bytes that a writable pipe takes at once (pipe(7)).
const CHUNK: usize = 4096;
/// Interval at which a waiting command checks whether it must end.
pub const LOOK_EVERY: Duration = Duration::from_millis(100);

const NICE: i32 = 5;

pub fn let_stages_go_first() {
    // If the kernel refuses, processes share the processor equally.
    let _ = rustix::process::nice(NICE);
}

pub struct Stream {
    signals: Signals,
    ended: bool,
}

impl Stream {
    /// Catches signals, so that the command leaves the bus before it ends.
    pub fn open() -> io::Result<Self> {
        let_stages_go_first();
        Self::with_usual_priority()
    }

    pub fn with_usual_priority() -> io::Result<Self> {
        Ok(Self { signals: Signals::that_end()?, ended: false })
    }

    pub fn has_ended(&mut self) -> bool {
        self.ended |= self.signals.came() || poll::is_closed(io::stdout()).unwrap_or(true);
        self.ended
    }

    pub fn pause(&self) -> io::Result<bool> {
        poll::is_readable(&self.signals, LOOK_EVERY)
    }

    /// Drops the rest if the command must end.
    pub fn write(&mut self, text: &str) -> io::Result<()> {
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
