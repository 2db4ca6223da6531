//! Exact field, for tests and benchmarks.

use std::num::NonZeroUsize;

use crate::{
    Cancellation, Domain, Field, Method, SolveError,
    multifrontal::{self, Job, Workspace},
    verification,
};

/// Solves `domain` by multifrontal factorisation, exact except for `f64` rounding, on maps of any
/// shape.
///
/// The field is returned even if its check fails.
///
/// # Errors
/// Succeeds on every valid map: the memory is unlimited and nothing cancels the solve.
pub fn solve_exactly(domain: &Domain) -> Result<Field, SolveError> {
    let cancellation = Cancellation::new();
    let job = Job::new(domain, u64::MAX, &cancellation);
    let ordered = multifrontal::order(job)?;
    let store = multifrontal::solve(job, &ordered, None, &mut Workspace::default())?;
    let store = multifrontal::relax(domain, &ordered.0, &store);
    let check = verification::check(domain, &store, NonZeroUsize::MIN);
    Ok(Field::new(domain, store, &check, Method::Multifrontal))
}
