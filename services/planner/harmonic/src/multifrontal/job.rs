//! Map to factorise, with limits of memory and operations, checked before a factorisation spends
//! them.

use crate::{Cancellation, Domain, SolveError};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Job<'a> {
    pub domain: &'a Domain,
    pub cancellation: &'a Cancellation,
    allowed: u64,
    operations: f64,
}

impl<'a> Job<'a> {
    pub(crate) fn new(domain: &'a Domain, allowed: u64, cancellation: &'a Cancellation) -> Self {
        Self { domain, cancellation, allowed, operations: f64::INFINITY }
    }

    pub(crate) fn with_operations(self, operations: f64) -> Self {
        Self { operations, ..self }
    }

    pub(super) fn ask_operations(self, operations: f64) -> Result<(), SolveError> {
        if operations <= self.operations { Ok(()) } else { self.ask(u64::MAX) }
    }

    pub(super) fn ask(self, needed: u64) -> Result<(), SolveError> {
        let Self { domain, allowed, .. } = self;
        if needed <= allowed {
            return Ok(());
        }
        let (width, height) = (domain.width(), domain.height());
        Err(SolveError::TooCostly { needed, allowed, width, height })
    }
}
