//! Process activity by the kernel's counts; distinguishes a starved process from a hung one.
//!
//! The leading thread sends the heartbeats, so its processor time counts. It may wait for any
//! thread, so starvation of all threads counts. The kernel adds a wait for a processor when it
//! ends; until then the thread state shows it.

use std::{fs, time::Duration};

use common::process_status::{scheduled, state};

/// Deadlines that a process may sleep before it counts as blocked. A slow disk takes more than one.
const BLOCKED_DEADLINES: u32 = 4;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum State {
    Ready,
    /// Stopped by a signal or a debugger.
    Stopped,
    /// Waiting for an event, a lock or a disk.
    #[default]
    Asleep,
}

/// Activity of a process since its start, or since an earlier time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Activity {
    pub ran: Duration,
    pub starved: Duration,
    pub state: State,
}

impl Activity {
    /// Returns the activity of process `pid` since its start; `None` if it has ended or is not
    /// counted.
    pub(crate) fn of(pid: u32) -> Option<Self> {
        let [ran, _] = scheduled(&pid.to_string())?;
        let threads = fs::read_dir(format!("/proc/{pid}/task")).ok()?.flatten();
        let paths = threads.map(|it| format!("{pid}/task/{}", it.file_name().display()));
        let starved = paths.filter_map(|path| Some(scheduled(&path)?[1])).sum();
        let state = match state(&pid.to_string())? {
            'R' => State::Ready,
            'T' | 't' => State::Stopped,
            _ => State::Asleep,
        };
        Some(Self { ran, starved, state })
    }

    pub(crate) const fn since(self, earlier: Self) -> Self {
        Self {
            ran: self.ran.saturating_sub(earlier.ran),
            starved: self.starved.saturating_sub(earlier.starved),
            ..self
        }
    }

    /// Returns whether a process without a sign of life for `age` is stopped, has run for
    /// `deadline`, or sleeps.
    pub(crate) fn is_hung(&self, age: Duration, deadline: Duration) -> bool {
        let slept = age.saturating_sub(self.ran + self.starved);
        let blocked = self.state == State::Asleep && slept >= deadline * BLOCKED_DEADLINES;
        self.state == State::Stopped || self.ran >= deadline || blocked
    }
}
