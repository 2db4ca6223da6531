//! A process: a child started from this very executable, or a guest that somebody else started; watched through
//! a pidfd, signalled, and reaped if it is ours.

use std::{
    fmt, fs, io,
    os::{
        fd::{AsFd, BorrowedFd, OwnedFd},
        unix::process::CommandExt,
    },
    process::{Child, ChildStdout, Command, ExitStatus, Stdio},
    time::{Duration, Instant},
};

use common::poll;
use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};

/// The kernel ends a killed process within this, unless it hangs in the kernel itself.
const KILLED_WITHIN: Duration = Duration::from_millis(50);

/// A `firsthand` subcommand in a process of its own.
///
/// Through `/proc/self/exe`, so that a rebuild under way does no harm; in a process group of its own, so
/// that a terminal's Ctrl-C reaches the supervisor alone, which stops things in order.
pub fn firsthand(arguments: &[&str]) -> Command {
    let mut command = Command::new("/proc/self/exe");
    command
        .arg0("firsthand")
        .args(arguments)
        .process_group(0)
        // What systemd says to the supervisor is not meant for its children.
        .env_remove("NOTIFY_SOCKET")
        .env_remove("WATCHDOG_USEC")
        .env_remove("WATCHDOG_PID")
        .stdin(Stdio::null());
    command
}

/// A process and the descriptor that becomes readable when it ends.
#[derive(Debug)]
pub struct Process {
    /// None of a guest: its parent reaps it.
    child: Option<Child>,
    id: u32,
    pidfd: OwnedFd,
}

/// How a process ended.
#[derive(Clone, Copy, Debug)]
pub enum Ended {
    /// A child, so.
    Child(ExitStatus),
    /// A guest; how, its parent knows.
    External,
}

impl fmt::Display for Ended {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Child(status) => status.fmt(f),
            Self::External => f.write_str("not our child; systemctl status says how"),
        }
    }
}

impl Process {
    /// Start `command`.
    pub fn spawn(mut command: Command) -> io::Result<Self> {
        let mut child = command.spawn()?;
        match pidfd_open(Pid::from_child(&child), PidfdFlags::empty()) {
            Ok(pidfd) => Ok(Self {
                id: child.id(),
                child: Some(child),
                pidfd,
            }),
            Err(error) => {
                // Unwatched it must not live.
                let _ = child.kill();
                let _ = child.wait();
                Err(error.into())
            }
        }
    }

    /// Watch process `id`, which calls itself `name` and spoke a moment ago, and which another started.
    pub fn adopt(id: u32, name: &str) -> io::Result<Self> {
        let pid = i32::try_from(id).ok().and_then(Pid::from_raw);
        let pid = pid.ok_or(io::ErrorKind::NotFound)?;
        let pidfd = pidfd_open(pid, PidfdFlags::empty())?;
        // Should it have died meanwhile and its number be another's, that one must not be signalled for it.
        let called = fs::read_to_string(format!("/proc/{id}/comm"))?;
        if called.trim_end() != name {
            return Err(io::ErrorKind::NotFound.into());
        }
        Ok(Self {
            child: None,
            id,
            pidfd,
        })
    }

    /// Its process id.
    pub const fn id(&self) -> u32 {
        self.id
    }

    /// Its standard output, once, if it is piped.
    pub fn take_stdout(&mut self) -> Option<ChildStdout> {
        self.child.as_mut()?.stdout.take()
    }

    /// Send it a signal; one that is gone gets none.
    pub fn signal(&self, signal: Signal) {
        let _ = pidfd_send_signal(&self.pidfd, signal);
    }

    /// Reap it, if it has ended.
    pub fn try_reap(&mut self) -> io::Result<Option<Ended>> {
        let Some(child) = &mut self.child else {
            let gone = self.wait(Duration::ZERO)?;
            return Ok(gone.then_some(Ended::External));
        };
        Ok(child.try_wait()?.map(Ended::Child))
    }

    /// Wait until it has ended; says whether it has.
    fn wait(&self, patience: Duration) -> io::Result<bool> {
        poll::is_readable(&self.pidfd, patience)
    }
}

impl Process {
    /// SIGTERM, and SIGKILL for one that is not gone after `grace`.
    pub fn end(&mut self, grace: Duration) {
        self.signal(Signal::TERM);
        let began = Instant::now();
        while matches!(self.try_reap(), Ok(None)) {
            let left = grace.saturating_sub(began.elapsed());
            if left.is_zero() {
                self.signal(Signal::KILL);
            }
            // RecoveredRun or not, it is looked at again.
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
    /// Nothing of ours is left running, whatever went wrong.
    fn drop(&mut self) {
        if let Some(child) = &mut self.child
            && !matches!(child.try_wait(), Ok(Some(_)))
        {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}
