//! Descriptors that a child must not inherit. The middleware opens its files without close-on-exec: each child would hold the
//! shared memory and the sockets of its parent as long as it runs.
//!
//! Why `unsafe` is allowed here: the kernel lists open descriptors as numbers, and a number becomes a descriptor only through
//! an `unsafe` call. Each is borrowed for one call that sets a flag; it is neither read, written nor closed.
#![allow(unsafe_code)]

use std::{fs, io, os::fd::BorrowedFd};

use rustix::io::{FdFlags, fcntl_setfd};

/// Standard input, output and error are the child's own.
const STANDARD: i32 = 2;

/// Close all but the standard descriptors in every program that this process executes from now on.
///
/// # Errors
/// When the system does not list them.
pub fn close_all_on_exec() -> io::Result<()> {
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
