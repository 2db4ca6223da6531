//! Descriptors that children must not inherit. The middleware opens files without close-on-exec, so
//! each child would keep its parent's shared memory and sockets open.
//!
//! Why `unsafe` is allowed here: the kernel lists open descriptors as numbers, and only an `unsafe`
//! call turns a number into a descriptor. Each is borrowed for one call that sets a flag; it is
//! neither read, written nor closed.
#![allow(unsafe_code)]

use std::{fs, io, os::fd::BorrowedFd};

use rustix::io::{FdFlags, fcntl_setfd};

/// Last of standard input, output and error, which belong to the child.
const STANDARD: i32 = 2;

/// Closes all but the standard descriptors in every program that this process executes from now on.
pub fn close_all_on_exec() -> io::Result<()> {
    for entry in fs::read_dir("/proc/self/fd")? {
        let name = entry?.file_name();
        let number = name.to_str().and_then(|name| name.parse().ok());
        let Some(number) = number.filter(|&number: &i32| number > STANDARD) else {
            continue;
        };
        // SAFETY: the number was just listed, so it is not -1. If another thread closes it
        // meanwhile, the kernel refuses the call.
        let descriptor = unsafe { BorrowedFd::borrow_raw(number) };
        // The kernel refuses only a descriptor closed meanwhile.
        let _ = fcntl_setfd(descriptor, FdFlags::CLOEXEC);
    }
    Ok(())
}
