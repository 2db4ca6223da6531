//! Waiting for descriptors. This module alone calls `poll`, and it retries after a signal.

use std::{
    io,
    os::fd::{AsFd, BorrowedFd},
    time::{Duration, Instant},
};

use rustix::{
    event::{PollFd, PollFlags, Timespec, poll},
    io::Errno,
};

/// Waits until one of `descriptors` is readable, closed or broken, or `timeout` has passed; `None`
/// waits indefinitely. Returns one flag per descriptor.
pub fn readable(
    descriptors: &[BorrowedFd<'_>],
    timeout: Option<Duration>,
) -> io::Result<Vec<bool>> {
    let mut all: Vec<_> = descriptors.iter().copied().map(polled).collect();
    wait(&mut all, timeout)?;
    Ok(all.iter().map(|descriptor| !descriptor.revents().is_empty()).collect())
}

pub(crate) fn polled(descriptor: BorrowedFd<'_>) -> PollFd<'_> {
    PollFd::from_borrowed_fd(descriptor, PollFlags::IN)
}

/// Returns whether `descriptor` is readable, closed or broken within `timeout`.
pub fn is_readable(descriptor: impl AsFd, timeout: Duration) -> io::Result<bool> {
    wait(&mut [polled(descriptor.as_fd())], Some(timeout))
}

/// Returns whether `descriptor` is writable, closed or broken within `timeout`.
pub fn is_writable(descriptor: impl AsFd, timeout: Duration) -> io::Result<bool> {
    wait(&mut [PollFd::new(&descriptor, PollFlags::OUT)], Some(timeout))
}

pub fn is_closed(descriptor: impl AsFd) -> io::Result<bool> {
    wait(&mut [PollFd::new(&descriptor, PollFlags::empty())], Some(Duration::ZERO))
}

pub(crate) fn wait(polled: &mut [PollFd<'_>], timeout: Option<Duration>) -> io::Result<bool> {
    let began = Instant::now();
    loop {
        let left = timeout.map(|timeout| timeout.saturating_sub(began.elapsed()));
        // A timeout beyond the system's range means none.
        match poll(polled, left.and_then(|left| Timespec::try_from(left).ok()).as_ref()) {
            Err(Errno::INTR) => {}
            came => return Ok(came? > 0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{io::Write as _, os::unix::net::UnixStream};

    const AT_ONCE: Option<Duration> = Some(Duration::ZERO);

    #[test]
    fn each_descriptor_is_told_apart() {
        let (idle, _other) = UnixStream::pair().unwrap();
        let (written, mut other) = UnixStream::pair().unwrap();
        let both = [idle.as_fd(), written.as_fd()];
        assert_eq!(readable(&both, AT_ONCE).unwrap(), [false, false]);
        other.write_all(b"x").unwrap();
        assert_eq!(readable(&both, None).unwrap(), [false, true]);
    }

    #[test]
    fn a_closed_end_is_readable() {
        let (end, other) = UnixStream::pair().unwrap();
        assert!(!is_readable(&end, Duration::ZERO).unwrap());
        assert!(!is_closed(&end).unwrap());
        drop(other);
        assert!(is_readable(&end, Duration::ZERO).unwrap());
        assert!(is_closed(&end).unwrap());
    }
}
