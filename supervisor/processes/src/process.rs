//! A child process or an external one, watched through a pidfd, signalled, and reaped if it is a
//! child.

use std::{
    ffi::OsStr,
    fmt, fs, io,
    os::{
        fd::{AsFd, BorrowedFd, OwnedFd},
        unix::process::{CommandExt, ExitStatusExt as _},
    },
    path::Path,
    process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio},
    time::{Duration, Instant},
};

use common::{bus::close_all_on_exec, poll, samples::DeathCause, stage_command, start::Generation};
use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};
use serde::Serialize;

/// Time for a killed process to end, unless it hangs in the kernel.
const KILLED_WITHIN: Duration = Duration::from_millis(50);

/// This program, even if a rebuild has replaced its file.
const OWN: &str = "/proc/self/exe";

pub fn firsthand(arguments: &[&str]) -> Command {
    let mut command = child(OWN);
    command.arg0("firsthand").args(arguments);
    command
}

/// A mission may name another `executable`.
pub fn stage(executable: Option<&Path>, generation: &Generation) -> Command {
    let (program, called) = program_of(executable, generation.stage);
    let mut command = child(program);
    if program == Path::new(OWN) {
        command.arg0("firsthand");
    }
    command.args(stage_command::arguments(called, generation, std::process::id()));
    command
}

/// Returns the program of `stage`, and the stage's name there.
///
/// An absolute `executable` is the program; any other names a planner of this one.
pub fn program_of<'a>(executable: Option<&'a Path>, stage: &'a str) -> (&'a Path, &'a str) {
    match executable {
        Some(path) if path.is_absolute() => (path, stage),
        name => (Path::new(OWN), name.and_then(Path::to_str).unwrap_or(stage)),
    }
}

/// Returns a command in its own process group, out of reach of a terminal's Ctrl-C.
pub fn child(program: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(program);
    command
        .process_group(0)
        // Only the supervisor may notify systemd.
        .env_remove("NOTIFY_SOCKET")
        .env_remove("WATCHDOG_USEC")
        .env_remove("WATCHDOG_PID")
        .stdin(Stdio::null());
    command
}

#[derive(Debug)]
pub struct Process {
    /// Child process; `None` for an external one, which its parent reaps.
    child: Option<Child>,
    id: u32,
    pidfd: OwnedFd,
}

#[derive(Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ExitCause {
    Exited(i32),
    Signalled {
        signal: i32,
        core: bool,
    },
    /// Only its parent knows the cause.
    Unknown,
}

impl From<ExitStatus> for ExitCause {
    fn from(status: ExitStatus) -> Self {
        match (status.code(), status.signal()) {
            (Some(code), _) => Self::Exited(code),
            (None, signal) => {
                Self::Signalled { signal: signal.unwrap_or_default(), core: status.core_dumped() }
            }
        }
    }
}

impl fmt::Display for ExitCause {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (cause, code) = self.coded();
        to.write_str(&cause.in_words(code))
    }
}

impl ExitCause {
    /// As in a death sample.
    pub(crate) const fn coded(&self) -> (DeathCause, i32) {
        match *self {
            Self::Exited(code) => (DeathCause::Exited, code),
            Self::Signalled { signal, core: false } => (DeathCause::Signalled, signal),
            Self::Signalled { signal, core: true } => (DeathCause::SignalledWithCore, signal),
            Self::Unknown => (DeathCause::Unknown, 0),
        }
    }
}

impl Process {
    /// The process inherits only the standard descriptors.
    pub fn spawn(mut command: Command) -> io::Result<Self> {
        close_all_on_exec()?;
        let mut child = command.spawn()?;
        match pidfd_open(Pid::from_child(&child), PidfdFlags::empty()) {
            Ok(pidfd) => Ok(Self { id: child.id(), child: Some(child), pidfd }),
            Err(error) => {
                // A process must not run unwatched.
                let _ = child.kill();
                let _ = child.wait();
                Err(error.into())
            }
        }
    }

    /// Watches the external process `id`, called `name`, which has just published.
    pub fn adopt(id: u32, name: &str) -> io::Result<Self> {
        let pid = i32::try_from(id).ok().and_then(Pid::from_raw).ok_or(io::ErrorKind::NotFound)?;
        let pidfd = pidfd_open(pid, PidfdFlags::empty())?;
        // The id may belong to another process by now.
        if fs::read_to_string(format!("/proc/{id}/comm"))?.trim_end() != name {
            return Err(io::ErrorKind::NotFound.into());
        }
        Ok(Self { child: None, id, pidfd })
    }

    pub const fn id(&self) -> u32 {
        self.id
    }

    pub fn take_stdout(&mut self) -> Option<ChildStdout> {
        self.child.as_mut()?.stdout.take()
    }

    pub fn take_stdin(&mut self) -> Option<ChildStdin> {
        self.child.as_mut()?.stdin.take()
    }

    pub fn signal(&self, signal: Signal) {
        let _ = pidfd_send_signal(&self.pidfd, signal);
    }

    pub fn try_reap(&mut self) -> io::Result<Option<ExitCause>> {
        let Some(child) = &mut self.child else {
            return Ok(self.wait(Duration::ZERO)?.then_some(ExitCause::Unknown));
        };
        Ok(child.try_wait()?.map(ExitCause::from))
    }

    fn wait(&self, patience: Duration) -> io::Result<bool> {
        poll::is_readable(&self.pidfd, patience)
    }

    /// Sends SIGTERM, then SIGKILL if the process has not ended after `grace`.
    pub fn end(&mut self, grace: Duration) {
        self.signal(Signal::TERM);
        let began = Instant::now();
        while matches!(self.try_reap(), Ok(None)) {
            let left = grace.saturating_sub(began.elapsed());
            if left.is_zero() {
                self.signal(Signal::KILL);
            }
            let _ = self.wait(left.max(KILLED_WITHIN));
        }
    }
}

impl AsFd for Process {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.pidfd.as_fd()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child
            && !matches!(child.try_wait(), Ok(Some(_)))
        {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}
