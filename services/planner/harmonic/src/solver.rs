//! From a domain to its verified field.
//!
//! - [`plan`]: which method to try first.
//! - [`full`]: one full solve: try, verify, fall back.

mod full;
mod plan;

use std::num::NonZeroUsize;

use crate::cancellation::Cancellation;
use crate::domain::Domain;
use crate::error::SolveError;
use crate::field::Field;
use crate::multifrontal::Workspace;
use full::Prepared;

/// How a solver may work; what full solves compute does not depend on it.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Threads a solve may use; the result is the same to the bit. Only the verification of large maps uses more than
    /// one.
    pub threads: NonZeroUsize,
    /// Bytes the multifrontal factorisation may take; a solve that needs more ends in [`SolveError::TooCostly`].
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

/// Solves fields. Between solves it holds the set-up, which does not depend on the target, and updates it where cells
/// changed.
#[derive(Debug, Default)]
pub struct Solver {
    settings: Settings,
    single: Prepared<f32>,
    double: Prepared<f64>,
    multifrontal: Workspace,
}

impl Solver {
    /// A solver without a set-up.
    pub fn new(settings: Settings) -> Self {
        Self {
            settings,
            ..Self::default()
        }
    }

    /// The verified field of `domain`.
    ///
    /// # Errors
    /// [`SolveError::Cancelled`], [`SolveError::TooCostly`], [`SolveError::Unverified`].
    pub fn solve(
        &mut self,
        domain: &Domain,
        cancellation: &Cancellation,
    ) -> Result<Field, SolveError> {
        self.solve_observed(domain, cancellation, &mut |_| {})
    }

    /// [`solve`](Self::solve), starting from the field of a similar map with the same size and target, which saves most of
    /// the cycles of multigrid; a field of another size or target is not used. The result is verified as ever, and depends on
    /// nothing but the arguments.
    ///
    /// # Errors
    /// See [`solve`](Self::solve).
    pub fn solve_near(
        &mut self,
        domain: &Domain,
        near: &Field,
        cancellation: &Cancellation,
    ) -> Result<Field, SolveError> {
        self.run(domain, Some(near), cancellation, &mut |_| {})
    }

    /// [`solve`](Self::solve), calling `observe` at the end of each phase: the library has no clock of its own.
    ///
    /// # Errors
    /// See [`solve`](Self::solve).
    pub fn solve_observed(
        &mut self,
        domain: &Domain,
        cancellation: &Cancellation,
        observe: &mut dyn FnMut(Phase),
    ) -> Result<Field, SolveError> {
        self.run(domain, None, cancellation, observe)
    }
}
