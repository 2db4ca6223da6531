//! Process activity by the kernel's counts; distinguishes a starved process from a hung one.
//!
//! The leading thread sends the heartbeats, so its processor time counts. It may wait for any
//! thread, so starvation of all threads counts. The kernel adds a wait for a processor when it
//! ends; until then the thread state shows it.

use std::{fs, time::Duration};

use common::process_status::{scheduled, state};

/// Deadlines that a process may sleep before it counts as blocked. A slow disk takes more than one.
pub(crate) const BLOCKED_DEADLINES: u32 = 4;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    Ready,
    /// Stopped by a signal or a debugger.
    Stopped,
    /// Waiting for an event, a lock or a disk.
    Asleep,
}

/// Activity of a process since its start or last beat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Activity {
    pub ran: Duration,
    pub starved: Duration,
    pub state: State,
}

impl Activity {
    /// Returns whether a process without a sign of life for `age` is stopped, has run for
    /// `deadline`, or sleeps.
    pub(crate) fn is_hung(&self, age: Duration, deadline: Duration) -> bool {
        let slept = age.saturating_sub(self.ran + self.starved);
        let blocked = self.state == State::Asleep && slept >= deadline * BLOCKED_DEADLINES;
        self.state == State::Stopped || self.ran >= deadline || blocked
    }
}

#[derive(Clone, Copy, Debug, Default)]
pub struct Times {
    pub ran: Duration,
    pub starved: Duration,
}

impl Times {
    /// Returns the times of process `pid`; `None` if it has ended or is not counted.
    pub(crate) fn of(pid: u32) -> Option<Self> {
        let [ran, _] = scheduled(&pid.to_string())?;
        let starved = fs::read_dir(format!("/proc/{pid}/task"))
            .ok()?
            .flatten()
            .map(|it| format!("{pid}/task/{}", it.file_name().display()))
            .filter_map(|path| Some(scheduled(&path)?[1]))
            .sum();
        Some(Self { ran, starved })
    }

    pub(crate) fn activity(self, pid: u32) -> Option<Activity> {
        let now = Self::of(pid)?;
        let state = match state(&pid.to_string())? {
            'R' => State::Ready,
            'T' | 't' => State::Stopped,
            _ => State::Asleep,
        };
        let ran = now.ran.saturating_sub(self.ran);
        Some(Activity { ran, starved: now.starved.saturating_sub(self.starved), state })
    }
}
