//! One wait for everything a process waits for: wakeups of topics, sockets, signals, other processes.

use std::{
    os::fd::{AsFd, BorrowedFd, OwnedFd},
    time::Duration,
};

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::bus::{BusError, Wakeup};

/// Waits for wakeups and foreign descriptors (sockets, signals, processes) at once.
#[derive(Debug, Default)]
pub struct Waiter {
    wakeups: Vec<Wakeup>,
    descriptors: Vec<OwnedFd>,
}

impl Waiter {
    /// Wake for `wakeup`.
    pub fn on(&mut self, wakeup: Wakeup) {
        self.wakeups.push(wakeup);
    }

    /// Wake when `descriptor` is readable; what is read from it is the caller's.
    ///
    /// # Errors
    /// When the process has no descriptor left.
    pub fn on_readable(&mut self, descriptor: impl AsFd) -> Result<(), BusError> {
        let own = descriptor
            .as_fd()
            .try_clone_to_owned()
            .map_err(BusError::Wait)?;
        self.descriptors.push(own);
        Ok(())
    }

    /// Wait until something rings, is readable, or `timeout` has passed; drains the wakeups. Says whether
    /// anything came.
    ///
    /// # Errors
    /// When the system refuses to wait.
    pub fn wait(&self, timeout: Duration) -> Result<bool, BusError> {
        self.wait_also_for(&[], timeout)
    }

    /// [`Waiter::wait`], for `others` too, this once.
    ///
    /// # Errors
    /// As [`Waiter::wait`].
    pub fn wait_also_for(
        &self,
        others: &[BorrowedFd<'_>],
        timeout: Duration,
    ) -> Result<bool, BusError> {
        let wakeups = self.wakeups.iter().map(AsFd::as_fd);
        let own = self.descriptors.iter().map(AsFd::as_fd);
        let mut polled: Vec<PollFd<'_>> = wakeups
            .chain(own)
            .chain(others.iter().copied())
            .map(|descriptor| PollFd::from_borrowed_fd(descriptor, PollFlags::IN))
            .collect();
        let timeout = Timespec::try_from(timeout).ok();
        let came = match poll(&mut polled, timeout.as_ref()) {
            Ok(ready) => ready > 0,
            // A signal that interrupts has also written to the signal pipe.
            Err(rustix::io::Errno::INTR) => true,
            Err(error) => return Err(BusError::Wait(error.into())),
        };
        let rang: Vec<bool> = polled
            .iter()
            .take(self.wakeups.len())
            .map(|entry| !entry.revents().is_empty())
            .collect();
        for (wakeup, rang) in self.wakeups.iter().zip(rang) {
            if rang {
                wakeup.drain()?;
            }
        }
        Ok(came)
    }
}
