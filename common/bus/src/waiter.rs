//! One wait for everything a process waits for: wakeups of topics, sockets, signals, other processes.

use std::{
    os::fd::{AsFd, BorrowedFd, OwnedFd},
    time::Duration,
};

use crate::{error::BusError, poll, read::Wakeup};

/// Waits for wakeups and other descriptors (sockets, signals, processes) at once.
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

    /// Wake when `descriptor` is readable; the caller reads from it.
    ///
    /// # Errors
    /// When the process has no descriptor left.
    pub fn on_readable(&mut self, descriptor: impl AsFd) -> Result<(), BusError> {
        let own = descriptor.as_fd().try_clone_to_owned().map_err(BusError::Wait)?;
        self.descriptors.push(own);
        Ok(())
    }

    /// Wait until a wakeup or descriptor is readable or `timeout` has passed; drains the wakeups. Returns whether
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
        let all: Vec<BorrowedFd<'_>> = wakeups.chain(own).chain(others.iter().copied()).collect();
        let came = poll::readable(&all, Some(timeout)).map_err(BusError::Wait)?;
        for (wakeup, _) in self.wakeups.iter().zip(&came).filter(|(_, came)| **came) {
            wakeup.drain()?;
        }
        Ok(came.contains(&true))
    }
}
