//! How many descriptors this process may have, and those that its children must not inherit. The middleware opens its files without close-on-exec: each
//! child would hold the shared memory and the sockets of its parent as long as it runs.
//!
//! Why `unsafe` is allowed here: the kernel lists open descriptors as numbers, and a number becomes a descriptor only through
//! an `unsafe` call. Each is borrowed for one call that sets a flag; it is neither read, written nor closed.
#![allow(unsafe_code)]

use std::{fs, io, os::fd::BorrowedFd};

use rustix::{
    io::{FdFlags, fcntl_setfd},
    process::{Resource, Rlimit, getrlimit, setrlimit},
};

/// A supervisor has about 130 open with no consumer on the bus, and as many again while stages are replaced.
const NEEDED: u64 = 256;

/// As many descriptors as the hard limit allows this process and its children. An error says the limit, if they are too
/// few: the middleware would report no more than that something failed.
pub(crate) fn raise_limit() -> Result<(), u64> {
    let Rlimit { maximum, .. } = getrlimit(Resource::Nofile);
    // One that cannot be raised is judged as it is.
    let _ = setrlimit(
        Resource::Nofile,
        Rlimit {
            current: maximum,
            maximum,
        },
    );
    match getrlimit(Resource::Nofile).current {
        Some(limit) if limit < NEEDED => Err(limit),
        _ => Ok(()),
    }
}

/// Standard input, output and error are the child's own.
const STANDARD: i32 = 2;

/// Have all but the standard descriptors closed in every program that this process executes from now on.
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
        // That of the listing itself is gone when this is over; a refusal is of one that was closed.
        let _ = fcntl_setfd(descriptor, FdFlags::CLOEXEC);
    }
    Ok(())
}
