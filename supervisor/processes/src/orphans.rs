//! Stages that still run in a domain that a new supervisor has locked. It waits for them, then
//! kills them.
//!
//! A running stage holds a shared lock on one file of the domain, and stops when its supervisor
//! ends. A frozen stage cannot.

use std::{
    fs::{self, File},
    io,
    time::{Duration, Instant},
};

use common::{
    domain::Domain,
    lock_holders::{holders, signal},
};
use rustix::process::Signal;

use crate::domain_error::{DomainError, failed};

/// Time for stages to end; they get SIGTERM when their supervisor ends.
const STOP_GRACE: Duration = Duration::from_secs(2);
/// Time for a killed process to end, unless it hangs in the kernel.
const KILLED: Duration = Duration::from_secs(1);
const JOINED_WITHIN: Duration = Duration::from_millis(300);
/// Interval of lock attempts; a file lock has no descriptor to wait on.
pub(crate) const RETRY: Duration = Duration::from_millis(10);

/// Waits until no stage runs in the domain, before its files are removed. The result blocks joining
/// stages.
pub(crate) fn wait_for(domain: &Domain) -> Result<File, DomainError> {
    let path = domain.stages_lock_file();
    let lock = File::create(&path).map_err(failed("make", &path))?;
    if locked_within(&lock, STOP_GRACE).map_err(failed("lock", &path))? {
        return Ok(lock);
    }
    let holders = holders(&lock).map_err(failed("look for who locks", &path))?;
    for &pid in &holders {
        tracing::warn!(pid, "a stage has outlived its supervisor and is killed");
        let _ = signal(pid, &lock, Signal::KILL);
    }
    if locked_within(&lock, KILLED).map_err(failed("lock", &path))? {
        return Ok(lock);
    }
    let holders: Vec<_> = holders.iter().map(u32::to_string).collect();
    Err(DomainError::Orphans { robot: domain.robot.to_string(), holders: holders.join(", ") })
}

/// Waits up to [`JOINED_WITHIN`] for joining consumers, which may be frozen. The result blocks
/// further ones.
pub(crate) fn wait_for_consumers(domain: &Domain) -> Result<File, DomainError> {
    let path = domain.joining_lock_file();
    let lock = File::create(&path).map_err(failed("make", &path))?;
    if !locked_within(&lock, JOINED_WITHIN).map_err(failed("lock", &path))? {
        tracing::warn!(
            "a consumer has been joining for {JOINED_WITHIN:?}; the bus is recreated without it"
        );
    }
    Ok(lock)
}

pub(crate) fn locked_within(file: &File, patience: Duration) -> io::Result<bool> {
    let began = Instant::now();
    loop {
        match file.try_lock() {
            Ok(()) => return Ok(true),
            Err(fs::TryLockError::WouldBlock) if began.elapsed() < patience => {
                std::thread::park_timeout(RETRY);
            }
            Err(fs::TryLockError::WouldBlock) => return Ok(false),
            Err(fs::TryLockError::Error(error)) => return Err(error),
        }
    }
}
