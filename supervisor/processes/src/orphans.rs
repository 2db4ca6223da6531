//! Stages that still run in a robot's domain when a new supervisor has locked it, which waits for them and kills those that
//! stay.
//!
//! Each stage holds a shared lock on one file of the domain as long as it runs, and stops when its supervisor ends. A frozen
//! stage cannot, and nobody needs it.

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

/// The time within which stages end: they get SIGTERM when their supervisor ends.
const STOP_GRACE: Duration = Duration::from_secs(2);
/// The time within which a killed process ends, unless it hangs in the kernel.
const KILLED: Duration = Duration::from_secs(1);
const JOINED_WITHIN: Duration = Duration::from_millis(300);
/// Pause between attempts to lock. A file lock has no descriptor to wait on.
pub(crate) const RETRY: Duration = Duration::from_millis(10);

/// Wait until no stage runs in the domain, because its files are removed next. No stage can join while the result is held.
pub(crate) fn wait_for(domain: &Domain) -> Result<File, DomainError> {
    let path = domain.stages_lock_file();
    let lock = File::create(&path).map_err(failed("make", &path))?;
    let system = |source| failed("lock", &path)(source);
    if locked_within(&lock, STOP_GRACE).map_err(system)? {
        return Ok(lock);
    }
    let holders = holders(&lock).map_err(failed("look for who locks", &path))?;
    for &pid in &holders {
        tracing::warn!(pid, "a stage has outlived its supervisor and is killed");
        // A stage that has just ended by itself needs no signal.
        let _ = signal(pid, &lock, Signal::KILL);
    }
    if locked_within(&lock, KILLED).map_err(system)? {
        return Ok(lock);
    }
    let holders: Vec<_> = holders.iter().map(u32::to_string).collect();
    Err(DomainError::Orphans { robot: domain.robot.to_string(), holders: holders.join(", ") })
}

/// Wait until no consumer is joining the bus, but not longer than [`JOINED_WITHIN`], because one may be frozen. None can begin to join
/// while the result is held.
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
