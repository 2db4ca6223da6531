//! Processes that hold a lock on a file, and signals that reach only such a process.

use std::{
    fs::{self, File, Metadata},
    io,
    os::unix::fs::MetadataExt as _,
    path::{Path, PathBuf},
};

use rustix::{
    io::Errno,
    process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal},
};

/// Returns the processes that hold a `flock` on `file`, by the descriptors of this user's
/// processes. Reading `/proc/locks` would stop every lock operation on the machine.
pub fn holders(file: &File) -> io::Result<Vec<u32>> {
    let file = file.metadata()?;
    let processes = fs::read_dir("/proc")?.flatten();
    let pids = processes.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    // Processes of other users hide their descriptors, and ended ones have none.
    Ok(pids
        .filter(|pid| descriptors(*pid, &file).is_ok_and(|mut all| all.any(|it| locks(&it))))
        .collect())
}

pub(crate) fn has_open(pid: u32, file: &File) -> bool {
    file.metadata().and_then(|file| Ok(descriptors(pid, &file)?.next().is_some())).unwrap_or(false)
}

fn descriptors(pid: u32, file: &Metadata) -> io::Result<impl Iterator<Item = PathBuf>> {
    let opened = fs::read_dir(format!("/proc/{pid}/fd"))?.flatten().map(|entry| entry.path());
    Ok(opened.filter(|path| {
        fs::metadata(path).is_ok_and(|it| (it.dev(), it.ino()) == (file.dev(), file.ino()))
    }))
}

fn locks(descriptor: &Path) -> bool {
    let facts = fs::read_to_string(descriptor.to_string_lossy().replace("/fd/", "/fdinfo/"));
    facts.is_ok_and(|facts| facts.contains("FLOCK"))
}

/// Sends `signal` to `pid` only if it has `file` open, because numbers are reused.
///
/// # Errors
/// [`io::ErrorKind::NotFound`] if the process has ended or lacks the file.
pub fn signal(pid: u32, file: &File, signal: Signal) -> io::Result<()> {
    let gone = || io::Error::from(io::ErrorKind::NotFound);
    let gone_or = |error: Errno| if error == Errno::SRCH { gone() } else { error.into() };
    let number = i32::try_from(pid).ok().and_then(Pid::from_raw);
    // The descriptor refers to this process even if its number is reused.
    let process = pidfd_open(number.ok_or_else(gone)?, PidfdFlags::empty()).map_err(gone_or)?;
    if descriptors(pid, &file.metadata()?)?.next().is_none() {
        return Err(gone());
    }
    pidfd_send_signal(&process, signal).map_err(gone_or)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_of_this_very_process_is_found() {
        let file = tempfile::tempfile().unwrap();
        assert_eq!(holders(&file).unwrap(), Vec::<u32>::new());
        file.lock_shared().unwrap();
        assert_eq!(holders(&file).unwrap(), [std::process::id()]);
    }
}
