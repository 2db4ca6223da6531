//! How a solver may work, and what it reports on the way.

use std::num::NonZeroUsize;

/// How a solver may work; what full solves compute does not depend on it.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Threads a solve may use; the result is the same to the bit. Only the verification of large maps uses more than
    /// one.
    pub threads: NonZeroUsize,
    /// Bytes the multifrontal factorisation may take; a solve that needs more ends in
    /// [`SolveError::TooCostly`](crate::SolveError::TooCostly).
    pub memory_limit: u64,
}

impl Default for Settings {
    /// One thread, 2 GiB.
    fn default() -> Self {
        Self {
            threads: NonZeroUsize::MIN,
            memory_limit: 2 << 30,
        }
    }
}

/// A step of a solve that has just ended, for callers that measure time.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum Phase {
    /// The part that does not depend on the target is ready.
    SetUp,
    /// One cycle of multigrid has ended.
    Cycled,
    /// A field was computed.
    Solved,
    /// The field was checked. If it failed, more cycles or a costlier method follow, with phases of their own.
    Verified,
}
