//! The exact field, for tests and benchmarks.

use std::num::NonZeroUsize;

use crate::{
    Cancellation, Domain, Field, Method, SolveError,
    multifrontal::{self, BreadthFirst, Budget, Tree, Workspace},
    verification,
};

/// The field of `domain` by multifrontal factorisation: exact but for the rounding of `f64`, on maps of any shape.
///
/// # Errors
/// See [`Solver::solve`](crate::Solver::solve).
pub fn solve_exactly(domain: &Domain) -> Result<Field, SolveError> {
    let cancellation = Cancellation::new();
    let budget = Budget::of(domain, u64::MAX);
    let pass = BreadthFirst::from_target(domain, &budget, &cancellation)?;
    let tree = Tree::of(&pass, &budget, &cancellation)?;
    let mut workspace = Workspace::default();
    let store =
        multifrontal::solve(domain, (&pass, &tree), None, &budget, &mut workspace, &cancellation)?;
    let store = multifrontal::relax(domain, &pass, &store);
    let check = verification::check(domain, &store, NonZeroUsize::MIN);
    Ok(Field::new(domain, store, &check, Method::Multifrontal))
}
