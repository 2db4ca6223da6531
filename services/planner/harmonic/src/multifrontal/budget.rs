//! The memory a factorisation may take, asked about before it is allocated.

use crate::domain::Domain;
use crate::error::SolveError;

/// Bytes allowed for the factorisation of one map.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Budget {
    allowed: u64,
    width: usize,
    height: usize,
}

impl Budget {
    /// `allowed` bytes for the factorisation of `domain`.
    pub(crate) fn of(domain: &Domain, allowed: u64) -> Self {
        Self { allowed, width: domain.width(), height: domain.height() }
    }

    /// # Errors
    /// [`SolveError::TooCostly`] if `needed` bytes are more than are allowed.
    pub(super) fn ask(&self, needed: u64) -> Result<(), SolveError> {
        let Self { allowed, width, height } = *self;
        if needed <= allowed {
            return Ok(());
        }
        Err(SolveError::TooCostly { needed, allowed, width, height })
    }
}
