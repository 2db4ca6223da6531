//! A child process: started from this very executable, watched through a pidfd, signalled, reaped.

use std::{
    io,
    os::{
        fd::{AsFd, BorrowedFd, OwnedFd},
        unix::process::CommandExt,
    },
    process::{Child, ChildStdout, Command, ExitStatus, Stdio},
    time::{Duration, Instant},
};

use rustix::{
    event::{PollFd, PollFlags, Timespec, poll},
    process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal},
};

/// The kernel ends a killed process within this, unless it hangs in the kernel itself.
const KILLED_WITHIN: Duration = Duration::from_millis(50);

/// A `firsthand` subcommand in a process of its own.
///
/// Through `/proc/self/exe`, so that a rebuild under way does no harm; in a process group of its own, so
/// that a terminal's Ctrl-C reaches the supervisor alone, which stops things in order.
pub(crate) fn firsthand(arguments: &[&str]) -> Command {
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

/// A child and the descriptor that becomes readable when it ends.
#[derive(Debug)]
pub(crate) struct Process {
    child: Child,
    pidfd: OwnedFd,
}

impl Process {
    /// Start `command`.
    pub(crate) fn spawn(mut command: Command) -> io::Result<Self> {
        let mut child = command.spawn()?;
        match pidfd_open(Pid::from_child(&child), PidfdFlags::empty()) {
            Ok(pidfd) => Ok(Self { child, pidfd }),
            Err(error) => {
                // Unwatched it must not live.
                let _ = child.kill();
                let _ = child.wait();
                Err(error.into())
            }
        }
    }

    /// Its process id.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Its standard output, once, if it is piped.
    pub(crate) fn take_stdout(&mut self) -> Option<ChildStdout> {
        self.child.stdout.take()
    }

    /// Send it a signal; one that is gone gets none.
    pub(crate) fn signal(&self, signal: Signal) {
        let _ = pidfd_send_signal(&self.pidfd, signal);
    }

    /// Reap it, if it has ended.
    pub(crate) fn try_reap(&mut self) -> io::Result<Option<ExitStatus>> {
        self.child.try_wait()
    }
}

impl Process {
    /// SIGTERM, and SIGKILL for one that is not gone after `grace`.
    pub(crate) fn end(&mut self, grace: Duration) {
        self.signal(Signal::TERM);
        let began = Instant::now();
        while matches!(self.child.try_wait(), Ok(None)) {
            let left = grace.saturating_sub(began.elapsed());
            if left.is_zero() {
                self.signal(Signal::KILL);
            }
            let mut polled = [PollFd::new(&self.pidfd, PollFlags::IN)];
            let timeout = Timespec::try_from(left.max(KILLED_WITHIN)).ok();
            // Interrupted or not, the child is looked at again.
            let _ = poll(&mut polled, timeout.as_ref());
        }
    }
}

impl AsFd for Process {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.pidfd.as_fd()
    }
}

impl Drop for Process {
    /// Nothing is left running, whatever went wrong.
    fn drop(&mut self) {
        if !matches!(self.child.try_wait(), Ok(Some(_))) {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}
