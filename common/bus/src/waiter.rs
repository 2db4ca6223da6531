//! A wait for all inputs of a process at once: wakeups of topics, sockets, signals, other processes.

use std::{
    os::fd::{AsFd, BorrowedFd, OwnedFd},
    time::Duration,
};

use crate::{
    error::{BusError, Result},
    poll,
    read::Wakeup,
};

/// Waits for wakeups and other descriptors (sockets, signals, processes) at once.
#[derive(Debug, Default)]
pub struct Waiter {
    wakeups: Vec<Wakeup>,
    descriptors: Vec<OwnedFd>,
}

impl Waiter {
    pub fn on(&mut self, wakeup: Wakeup) {
        self.wakeups.push(wakeup);
    }

    /// Wait for `descriptor` too, until it is readable; the caller reads from it. An error means that the process has no descriptor left.
    pub fn on_readable(&mut self, descriptor: impl AsFd) -> Result {
        let own = descriptor.as_fd().try_clone_to_owned().map_err(BusError::Wait)?;
        self.descriptors.push(own);
        Ok(())
    }

    /// Wait until a wakeup or a descriptor is readable or `timeout` has passed, and drain the wakeups. Returns whether anything was
    /// readable.
    pub fn wait(&self, timeout: Duration) -> Result<bool> {
        self.wait_also_for(&[], timeout)
    }

    pub fn wait_also_for(&self, others: &[BorrowedFd<'_>], timeout: Duration) -> Result<bool> {
        let wakeups = self.wakeups.iter().map(AsFd::as_fd);
        let own = self.descriptors.iter().map(AsFd::as_fd);
        let all: Vec<BorrowedFd<'_>> = wakeups.chain(own).chain(others.iter().copied()).collect();
        let mut woken = false;
        for wakeup in &self.wakeups {
            woken |= wakeup.drain_what_came_meanwhile()?;
        }
        let timeout = if woken { Duration::ZERO } else { timeout };
        let came = poll::readable(&all, Some(timeout)).map_err(BusError::Wait)?;
        for (wakeup, _) in self.wakeups.iter().zip(&came).filter(|(_, came)| **came) {
            wakeup.drain()?;
        }
        Ok(woken || came.contains(&true))
    }
}
