//! Memory of segments, reserved at creation. The middleware creates segments by `ftruncate`, which
//! sets a length without memory. If the shared memory file system fills up later, the first write
//! to a page raises SIGBUS.
//!
//! This crate therefore defines the `ftruncate` that the middleware calls. It also reserves memory,
//! or fails so that the middleware refuses the port.
//!
//! Most segments have many more places than are used, for samples that frozen consumers hold. The
//! middleware takes the most recently returned place, so only a segment's first part is used and
//! reserved at once. [`Places`] reserves the rest place by place.
//!
//! Why `unsafe` is allowed here:
//! - A function of that name replaces the C library's for the whole program. It has the same
//!   signature and meaning; it only fails earlier. The standard library and `rustix` do not call
//!   it. It borrows the caller's descriptor until it returns, and sets `errno` as the C library
//!   does.
//! - The advice that reserves places changes no byte of any memory.
#![allow(unsafe_code)]

use std::{
    cell::Cell,
    ffi::{c_int, c_long, c_void},
    io,
    os::fd::BorrowedFd,
    ptr,
};

use rustix::{
    fs::{FallocateFlags, fallocate, ftruncate as set_length},
    io::{Errno, Result, retry_on_intr},
    param::page_size,
};

/// Longest segment that is reserved as a whole.
const WHOLE: u64 = 512 << 10;
/// Reserved fraction (1/32) of a longer segment: eight maps of the field, more than are in flight.
const SHARE: u64 = 32;

/// Advice of Linux 5.14 and later: allocate pages as a write to each would.
const MADV_POPULATE_WRITE: c_int = 23;

unsafe extern "C" {
    fn __errno_location() -> *mut c_int;
    fn madvise(address: *mut c_void, length: usize, advice: c_int) -> c_int;
}

/// POSIX `ftruncate` that also reserves memory.
#[unsafe(no_mangle)]
extern "C" fn ftruncate(descriptor: c_int, length: c_long) -> c_int {
    // SAFETY: the caller owns the descriptor.
    let file = (descriptor >= 0).then(|| unsafe { BorrowedFd::borrow_raw(descriptor) });
    let outcome = match (file, u64::try_from(length)) {
        (None, _) => Err(Errno::BADF),
        (_, Err(_)) => Err(Errno::INVAL),
        (Some(file), Ok(length)) => lengthen(file, length),
    };
    let Err(error) = outcome else {
        return 0;
    };
    // SAFETY: the C library gives the address of this thread's error number.
    unsafe { *__errno_location() = error.raw_os_error() };
    -1
}

fn lengthen(file: BorrowedFd<'_>, length: u64) -> Result<()> {
    set_length(file, length)?;
    let reserved = length.min(WHOLE.max(length / SHARE));
    if reserved == 0 {
        return Ok(());
    }
    match retry_on_intr(|| fallocate(file, FallocateFlags::KEEP_SIZE, 0, reserved)) {
        // Such a file system does not reserve.
        Err(Errno::OPNOTSUPP) => Ok(()),
        reserved => reserved,
    }
}

/// Sample places of equal length in a publisher's segment.
///
/// A fresh place is taken only while all before it are in use. The place behind it gets memory
/// before the sample is sent, or the taken place is given back.
#[derive(Debug)]
pub(crate) struct Places {
    length: usize,
    /// Address up to which the places have memory.
    reserved: Cell<usize>,
}

impl Places {
    /// Takes the addresses of the first two places.
    pub(crate) const fn of_segment([first, second]: [usize; 2]) -> Self {
        assert!(first != second);
        Self { length: second.abs_diff(first), reserved: Cell::new(first) }
    }

    /// Returns whether it succeeded.
    pub(crate) fn reserve_behind(&self, taken: usize) -> bool {
        let start = self.reserved.get();
        let end = taken + 2 * self.length;
        if end <= start {
            return true;
        }
        let page = start - start % page_size();
        let address = ptr::with_exposed_provenance_mut(page);
        // SAFETY: the advice changes no byte.
        let failed = unsafe { madvise(address, end - page, MADV_POPULATE_WRITE) } != 0;
        let error = failed.then(|| Errno::from_io_error(&io::Error::last_os_error())).flatten();
        let has_memory = !matches!(error, Some(Errno::FAULT | Errno::NOMEM));
        // An older kernel does not know the advice.
        if has_memory {
            self.reserved.set(end);
        }
        has_memory
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::{fd::AsRawFd as _, unix::fs::MetadataExt as _};

    unsafe extern "C" {
        #[link_name = "ftruncate"]
        safe fn called_by_the_middleware(descriptor: c_int, length: c_long) -> c_int;
    }

    #[test]
    fn a_segment_that_the_middleware_makes_has_its_memory() {
        let file = tempfile::tempfile_in(crate::domain::SHARED_MEMORY).unwrap();
        for (length, reserved) in [(1 << 16, 1 << 16), (64 << 20, 2 << 20)] {
            assert_eq!(called_by_the_middleware(file.as_raw_fd(), length), 0);
            let found = file.metadata().unwrap();
            assert_eq!((found.len(), found.blocks() * 512), (length as u64, reserved));
        }
        assert_eq!(called_by_the_middleware(-1, 1), -1);
        assert_eq!(io::Error::last_os_error().raw_os_error(), Some(Errno::BADF.raw_os_error()));
    }
}
