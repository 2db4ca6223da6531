//! Limits of memory and operations, checked before a factorisation spends them.

use crate::{Domain, SolveError};

/// Bytes and multiplications allowed for the factorisation of one map.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Budget {
    allowed: u64,
    operations: f64,
    width: usize,
    height: usize,
}

impl Budget {
    pub(crate) fn of(domain: &Domain, allowed: u64) -> Self {
        let (width, height) = (domain.width(), domain.height());
        Self { allowed, operations: f64::INFINITY, width, height }
    }

    pub(crate) fn with_operations(self, operations: f64) -> Self {
        Self { operations, ..self }
    }

    pub(super) fn ask_operations(&self, operations: f64) -> Result<(), SolveError> {
        if operations <= self.operations { Ok(()) } else { self.ask(u64::MAX) }
    }

    pub(super) fn ask(&self, needed: u64) -> Result<(), SolveError> {
        let Self { allowed, width, height, .. } = *self;
        if needed <= allowed {
            return Ok(());
        }
        Err(SolveError::TooCostly { needed, allowed, width, height })
    }
}
