//! The limit of this process's descriptors, and the descriptors that its children must not inherit. The middleware opens its
//! files without close-on-exec: each child would hold the shared memory and the sockets of its parent as long as it runs.
//!
//! Why `unsafe` is allowed here: the kernel lists open descriptors as numbers, and a number becomes a descriptor only through
//! an `unsafe` call. Each is borrowed for one call that sets a flag; it is neither read, written nor closed.
#![allow(unsafe_code)]

use std::{fs, io, os::fd::BorrowedFd};

use rustix::{
    io::{FdFlags, fcntl_setfd},
    process::{Resource, Rlimit, setrlimit},
};

/// A supervisor has some 200 open.
const NEEDED: u64 = 256;

/// Raise the limit of descriptors to the hard limit. The error is the limit, if it is too low: the middleware would report
/// only that something failed.
pub(crate) fn raise_limit() -> Result<(), u64> {
    let Some([_, hard]) = limits() else {
        return Ok(());
    };
    let limit = Rlimit { current: Some(hard), maximum: Some(hard) };
    // If the limit cannot be raised, as under the service's unit, the present limit stays.
    let _ = setrlimit(Resource::Nofile, limit);
    match limits() {
        Some([soft, _]) if soft < NEEDED => Err(soft),
        _ => Ok(()),
    }
}

/// The soft and the hard limit; none where the kernel does not say, or there is none. They are read from text, because the
/// system call may be forbidden to a service.
fn limits() -> Option<[u64; 2]> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits.lines().find_map(|line| line.strip_prefix("Max open files"))?;
    let mut numbers = line.split_ascii_whitespace().map(str::parse);
    Some([numbers.next()?.ok()?, numbers.next()?.ok()?])
}

/// Standard input, output and error are the child's own.
const STANDARD: i32 = 2;

/// Close all but the standard descriptors in every program that this process executes from now on.
pub(crate) fn close_all_on_exec() -> io::Result<()> {
    for entry in fs::read_dir("/proc/self/fd")? {
        let name = entry?.file_name();
        let number = name.to_str().and_then(|name| name.parse().ok());
        let Some(number) = number.filter(|&number: &i32| number > STANDARD) else {
            continue;
        };
        // SAFETY: the number was listed a moment ago, so it is not -1; should another thread close it meanwhile, the
        // kernel refuses the call.
        let descriptor = unsafe { BorrowedFd::borrow_raw(number) };
        // The kernel refuses only a descriptor that was closed meanwhile.
        let _ = fcntl_setfd(descriptor, FdFlags::CLOEXEC);
    }
    Ok(())
}
