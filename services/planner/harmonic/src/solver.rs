//! From a domain to its verified field.
//!
//! - [`plan`]: which method to try first.
//! - [`full`]: one full solve: try, verify, fall back.
//! - [`settings`]: threads and memory.

mod full;
mod plan;
mod settings;

use crate::cancellation::Cancellation;
use crate::domain::Domain;
use crate::error::SolveError;
use crate::field::Field;
use full::{Full, Task};
pub use settings::{Phase, Settings};

/// Solves fields. Between solves it holds the set-up, which does not depend on the target, and updates it where cells
/// changed.
#[derive(Debug, Default)]
pub struct Solver {
    settings: Settings,
    full: Full,
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
        self.full.solve(
            Task {
                settings: &self.settings,
                domain,
                near: Some(near),
                cancellation,
            },
            &mut |_| {},
        )
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
        self.full.solve(
            Task {
                settings: &self.settings,
                domain,
                near: None,
                cancellation,
            },
            observe,
        )
    }
}
