//! From a domain to its verified field, and a field brought up to date.
//!
//! - [`plan`]: which method to try first.
//! - [`full`]: one full solve: try, verify, fall back.
//! - [`settings`]: threads and memory.

mod full;
mod plan;
mod settings;

use crate::cancellation::Cancellation;
use crate::cell::Change;
use crate::domain::Domain;
use crate::error::SolveError;
use crate::field::Field;
use crate::local::{LocalUpdate, Verdict};
use full::{Full, Task};
pub use settings::{Phase, Settings};

/// Solves fields. Between solves it keeps the set-up, which does not depend on the target, and updates it where cells
/// changed.
#[derive(Debug, Default)]
pub struct Solver {
    settings: Settings,
    full: Full,
    local: LocalUpdate,
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
    /// the cycles of multigrid. The result is verified as ever, and depends on nothing but the arguments.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
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
    /// As [`solve`](Self::solve).
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

    /// Applies `changes` to `domain` and brings its `field` up to date: by a full solve that starts from it on maps of up to
    /// [`Settings::whole_up_to`] cells, else in a window around the changes, or by a full solve where the window would be half
    /// of the map.
    ///
    /// `field` may be older than `domain`: a change counts if the cell is not yet so in the field. So when a field solved in
    /// the background is swapped in, update it with all changes since that solve began. An update in a window is
    /// provisional: follow it by a full solve ([`solve_near`](Self::solve_near)), and until then trust the directions only
    /// where [`Field::is_trusted`] says so.
    ///
    /// # Errors
    /// [`SolveError::Outside`], [`SolveError::TargetBlocked`] and [`SolveError::ForeignField`], with neither domain nor
    /// field changed; the errors of [`solve`](Self::solve), with the changes made to the domain and the field not to be
    /// followed before a full solve.
    pub fn update(
        &mut self,
        domain: &mut Domain,
        field: &mut Field,
        changes: &[Change],
        cancellation: &Cancellation,
    ) -> Result<Verdict, SolveError> {
        if !field.fits(domain) {
            return Err(SolveError::ForeignField);
        }
        domain.apply(changes)?;
        // Compared with the field, not with the map before: a change may be reported twice.
        let changes: Vec<Change> = changes
            .iter()
            .copied()
            .filter(|change| field.is_blocked(change.cell) != change.blocked)
            .collect();
        if changes.is_empty() {
            let whole = field.patches().is_empty();
            return Ok(if whole {
                Verdict::Solved
            } else {
                Verdict::Provisional
            });
        }
        if domain.blocked().len() > self.settings.whole_up_to
            && let Some(verdict) = self.local.update(domain, field, &changes)
        {
            return Ok(verdict);
        }
        *field = self.solve_near(domain, field, cancellation)?;
        Ok(Verdict::Solved)
    }
}
