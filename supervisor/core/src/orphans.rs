//! Stages that still run in a robot's domain when a supervisor has locked it: waited for, and killed if they stay.
//!
//! Each stage holds a shared lock on one file of the domain as long as it runs, and stops when its supervisor ends. One
//! that is frozen cannot. Only the process that holds the supervisor's lock can need the stages of the domain, so such
//! an orphan is killed.

use std::{
    fs::{self, File},
    io,
    os::unix::fs::MetadataExt,
    time::{Duration, Instant},
};

use common::domain::Domain;
use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};

use crate::domain_error::{DomainError, failed};

/// Stages get SIGTERM when their supervisor ends, and end within this.
const STOP_GRACE: Duration = Duration::from_secs(2);
/// A killed process ends within this, unless it hangs in the kernel.
const KILLED: Duration = Duration::from_secs(1);
/// How often the lock is tried: a file lock has no descriptor to wait on.
const RETRY: Duration = Duration::from_millis(10);

/// Wait until no stage runs in the domain: what they use is wiped next. None can join while the result is held.
pub(crate) fn wait_for(domain: &Domain) -> Result<File, DomainError> {
    let path = domain.stages_lock_file();
    let lock = File::create(&path).map_err(failed("make", &path))?;
    let system = |source| failed("lock", &path)(source);
    if locked_within(&lock, STOP_GRACE).map_err(system)? {
        return Ok(lock);
    }
    let holders = holders(&lock).map_err(failed("look for who locks", &path))?;
    for &pid in &holders {
        tracing::warn!(pid, "a stage outlives its supervisor: killed");
        // One that has just ended by itself needs no signal.
        let _ = kill(pid, &lock);
    }
    if locked_within(&lock, KILLED).map_err(system)? {
        return Ok(lock);
    }
    let holders: Vec<_> = holders.iter().map(u32::to_string).collect();
    Err(DomainError::Orphans {
        robot: domain.robot.to_string(),
        holders: holders.join(", "),
    })
}

/// Whether the exclusive lock on `file` was acquired in time.
fn locked_within(file: &File, patience: Duration) -> io::Result<bool> {
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

/// The processes that hold a lock on `file`.
fn holders(file: &File) -> io::Result<Vec<u32>> {
    let inode = file.metadata()?.ino();
    Ok(lockers(&fs::read_to_string("/proc/locks")?, inode))
}

/// The processes that hold a file lock on this inode, as `/proc/locks` lists it: number, kind, mode, access, process,
/// device and inode. A process that only waits for one has an arrow before the kind.
fn lockers(locks: &str, inode: u64) -> Vec<u32> {
    let holder = |line: &str| {
        let mut words = line.split_ascii_whitespace().skip(1);
        let ("FLOCK", _, _, pid, file) = (
            words.next()?,
            words.next()?,
            words.next()?,
            words.next()?,
            words.next()?,
        ) else {
            return None;
        };
        let locked: u64 = file.rsplit(':').next()?.parse().ok()?;
        (locked == inode).then_some(pid.parse().ok()?)
    };
    locks.lines().filter_map(holder).collect()
}

/// Kill process `pid` if it has `file` open: inodes of two file systems may have one number.
fn kill(pid: u32, file: &File) -> io::Result<()> {
    let number = i32::try_from(pid).ok().and_then(Pid::from_raw);
    let process = pidfd_open(number.ok_or(io::ErrorKind::NotFound)?, PidfdFlags::empty())?;
    let file = file.metadata()?;
    let opened = fs::read_dir(format!("/proc/{pid}/fd"))?.flatten();
    let ours = opened
        .filter_map(|entry| fs::metadata(entry.path()).ok())
        .any(|opened| (opened.dev(), opened.ino()) == (file.dev(), file.ino()));
    if ours {
        pidfd_send_signal(&process, Signal::KILL)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holders_of_a_lock_are_distinguished_from_waiting_processes_and_other_files() {
        let locks = "\
1: FLOCK  ADVISORY  READ 11 fe:00:77 0 EOF
2: POSIX  ADVISORY  WRITE 12 fe:00:77 0 EOF
3: FLOCK  ADVISORY  READ 13 fe:00:78 0 EOF
4: FLOCK  ADVISORY  READ 14 00:31:77 0 EOF
4: -> FLOCK  ADVISORY  WRITE 15 00:31:77 0 EOF
5: FLOCK
";
        assert_eq!(lockers(locks, 77), [11, 14]);
    }

    #[test]
    fn a_lock_of_this_very_process_is_found() {
        let file = tempfile::tempfile().unwrap();
        assert_eq!(holders(&file).unwrap(), Vec::<u32>::new());
        file.lock_shared().unwrap();
        assert_eq!(holders(&file).unwrap(), [std::process::id()]);
    }
}
