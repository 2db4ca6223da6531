//! Wait for all inputs of a process at once: wakeups of topics, sockets, signals, other processes.

use std::{
    io,
    os::fd::{AsFd, BorrowedFd, OwnedFd},
    time::Duration,
};

use crate::{
    error::{BusError, Result},
    machine,
    poll::{self, polled},
    read::Wakeup,
};

#[derive(Debug, Default)]
pub struct Waiter {
    wakeups: Vec<Wakeup>,
    descriptors: Vec<OwnedFd>,
}

impl Waiter {
    pub fn on(&mut self, wakeup: Wakeup) {
        self.wakeups.push(wakeup);
    }

    /// The caller reads from `descriptor`.
    pub fn on_readable(&mut self, descriptor: impl AsFd) -> Result {
        self.descriptors.push(descriptor.as_fd().try_clone_to_owned().map_err(BusError::Wait)?);
        Ok(())
    }

    /// Waits until an input is readable or `timeout` has passed, and drains the wakeups.
    pub fn wait(&self, timeout: Duration) -> Result<bool> {
        self.wait_also_for(&[], timeout)
    }

    /// Only on a simulated machine.
    pub fn is_woken(&self) -> bool {
        self.wakeups.iter().any(Wakeup::is_woken)
    }

    pub fn wait_also_for(&self, others: &[BorrowedFd<'_>], timeout: Duration) -> Result<bool> {
        if let Some(machine) = machine::simulated() {
            let came = machine.wait(timeout, &|| self.is_woken());
            if machine.is_killed() {
                return Err(BusError::Wait(io::ErrorKind::BrokenPipe.into()));
            }
            self.wakeups.iter().try_for_each(|wakeup| wakeup.drain().map(drop))?;
            return Ok(came);
        }
        let wakeups = self.wakeups.iter().filter_map(Wakeup::descriptor);
        let own = self.descriptors.iter().map(AsFd::as_fd);
        let all = wakeups.chain(own).chain(others.iter().copied());
        let mut all: Vec<_> = all.map(polled).collect();
        let mut woken = false;
        for wakeup in &self.wakeups {
            woken |= wakeup.drain_what_came_meanwhile()?;
        }
        let timeout = if woken { Duration::ZERO } else { timeout };
        let came = poll::wait(&mut all, Some(timeout)).map_err(BusError::Wait)?;
        for (wakeup, polled) in self.wakeups.iter().zip(&all) {
            if !polled.revents().is_empty() {
                wakeup.drain()?;
            }
        }
        Ok(woken || came)
    }
}
