//! The processes that hold a lock on a file, and signals that reach only such a process.

use std::{
    collections::BTreeSet,
    fs::{self, File},
    io,
    os::unix::fs::MetadataExt as _,
};

use rustix::{
    io::Errno,
    process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal},
};

/// The number of times that the list of locks is read. A list longer than a page is read in parts and may change between them:
/// with 180 locks that came and went, one reading in 200 missed a lock that was held all the time.
const READINGS: usize = 5;

pub fn holders(file: &File) -> io::Result<Vec<u32>> {
    let inode = file.metadata()?.ino();
    let mut found = BTreeSet::new();
    for _ in 0..READINGS {
        found.extend(lockers(&fs::read_to_string("/proc/locks")?, inode));
    }
    Ok(found.into_iter().collect())
}

/// The processes that hold a lock on the file with this inode. A line of `/proc/locks` has number, kind, mode, access, process,
/// device and inode. A process that only waits for a lock has an arrow before the kind.
fn lockers(locks: &str, inode: u64) -> Vec<u32> {
    let holder = |line: &str| {
        let mut words = line.split_ascii_whitespace().skip(1);
        let ("FLOCK", _, _, pid, file) =
            (words.next()?, words.next()?, words.next()?, words.next()?, words.next()?)
        else {
            return None;
        };
        let locked: u64 = file.rsplit(':').next()?.parse().ok()?;
        (locked == inode).then_some(pid.parse().ok()?)
    };
    locks.lines().filter_map(holder).collect()
}

/// Send `signal` to process `pid` if it has `file` open. That is checked because another process may have this number by now, and
/// because [`holders`] may confuse inodes of two file systems. If the process has ended or does not have the file open, the error
/// is [`io::ErrorKind::NotFound`].
pub fn signal(pid: u32, file: &File, signal: Signal) -> io::Result<()> {
    let gone = || io::Error::from(io::ErrorKind::NotFound);
    let gone_or = |error: Errno| if error == Errno::SRCH { gone() } else { error.into() };
    let number = i32::try_from(pid).ok().and_then(Pid::from_raw);
    // The descriptor refers to this process even if the process ends and its number is used again.
    let process = pidfd_open(number.ok_or_else(gone)?, PidfdFlags::empty()).map_err(gone_or)?;
    let file = file.metadata()?;
    let opened = fs::read_dir(format!("/proc/{pid}/fd"))?.flatten();
    let ours = opened
        .filter_map(|entry| fs::metadata(entry.path()).ok())
        .any(|opened| (opened.dev(), opened.ino()) == (file.dev(), file.ino()));
    if !ours {
        return Err(gone());
    }
    pidfd_send_signal(&process, signal).map_err(gone_or)
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
