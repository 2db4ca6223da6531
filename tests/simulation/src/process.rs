//! A stage's process on a simulated machine.

use std::time::Duration;

use common::{run::Run, shell::Simulated, start::Generation};
use processes::{
    activity::{Activity, State},
    process::ExitCause,
};
use rustix::process::Signal;

#[derive(Default)]
pub struct Process {
    pub stage: &'static str,
    /// Until its first turn.
    pub starts: Option<(Generation, Run)>,
    pub turns: Option<Box<dyn Simulated>>,
    /// End of the wait for input.
    pub due_ns: u64,
    /// Turn of a process that waits for a processor.
    pub woken_ns: Option<u64>,
    /// End of the last turn.
    pub busy_until_ns: u64,
    pub frozen: bool,
    /// Start of a computation that never ends.
    pub spins_since_ns: Option<u64>,
    pub is_terminated: bool,
    pub exit: Option<ExitCause>,
    pub ran: Duration,
    pub starved: Duration,
    /// Part of the wait for a processor that counts when it ends.
    pub starves: Duration,
}

impl Process {
    pub fn new(generation: &Generation, run: Run, due_ns: u64) -> Self {
        Self {
            stage: generation.stage,
            starts: Some((generation.clone(), run)),
            due_ns,
            busy_until_ns: due_ns,
            ..Self::default()
        }
    }

    pub fn is_live(&self) -> bool {
        self.exit.is_none()
    }

    /// Returns the time of the next turn, or of the wakeup before it.
    pub fn next_ns(&self) -> Option<u64> {
        let runs = self.is_live() && !self.frozen && self.spins_since_ns.is_none();
        runs.then(|| self.woken_ns.unwrap_or(self.due_ns))
    }

    /// Returns the time that the process ran and starved since its start, and its state.
    pub fn activity(&self, now_ns: u64) -> Activity {
        let since = |ns: u64| Duration::from_nanos(now_ns.saturating_sub(ns));
        let state = match self {
            Self { frozen: true, .. } => State::Stopped,
            Self { spins_since_ns: Some(_), .. } => State::Ready,
            Self { woken_ns: Some(woken), .. } if *woken > now_ns => State::Ready,
            _ => State::Asleep,
        };
        let ran = self.ran + self.spins_since_ns.map_or(Duration::ZERO, since);
        Activity { ran, starved: self.starved, state }
    }
}

pub const fn killed_by(signal: Signal) -> ExitCause {
    ExitCause::Signalled { signal: signal.as_raw(), core: false }
}
