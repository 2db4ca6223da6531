//! The kinds of hits on a process.

use rustix::process::Signal;
use serde::{Deserialize, Serialize};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    #[default]
    Kill,
    /// SIGKILL in the first milliseconds of a generation.
    KillAtStart,
    /// SIGABRT, as after a panic that cannot unwind. SIGSEGV would not serve: Rust's runtime takes the first one for an overflow
    /// of the stack, finds none, and goes on.
    Crash,
    Terminate,
    /// SIGSTOP.
    Freeze,
    /// SIGSTOP to supervisor and stages together, SIGCONT a moment later.
    FreezeAll,
}

impl Kind {
    pub const fn signal(self) -> Signal {
        match self {
            Self::Kill | Self::KillAtStart => Signal::KILL,
            Self::Crash => Signal::ABORT,
            Self::Terminate => Signal::TERM,
            Self::Freeze | Self::FreezeAll => Signal::STOP,
        }
    }
}
