//! From a domain to its field: the methods, the choice between them, and the verification that decides.
//!
//! - [`pricing`]: which method to try first.
//! - [`multigrid`]: a few sweeps' worth of work a cell; right where the map is wide.
//! - [`elimination`]: exact, in extended range; cheap where the map is narrow.
//! - [`bands`]: multigrid again and again where u spans more than an `f64`.
//! - [`breadth`]: the breadth-first pass that orders and prices the elimination.
//! - [`full`]: one full solve: try, check, fall back.
//! - [`certificate`]: the check every field must pass before it is handed out.
//! - [`wide`]: the widest vectors of the machine.

mod bands;
mod breadth;
pub(crate) mod certificate;
mod elimination;
mod full;
pub(crate) mod multigrid;
mod pricing;
mod wide;

use std::num::NonZeroUsize;

use crate::cancellation::Cancellation;
use crate::domain::{Change, Domain};
use crate::error::SolveError;
use crate::field::Field;
use crate::repair::Repair;

/// How a solver may work; what it computes does not depend on it.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Threads a solve may use; the result is the same bit for bit. So far only the verification of large maps is spread
    /// over them.
    pub threads: NonZeroUsize,
    /// Bytes the elimination may take before a solve gives up with [`SolveError::TooCostly`].
    pub memory_limit: u64,
}

impl Default for Settings {
    /// One thread: the robot has others to feed. 2 GiB.
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
    /// What does not depend on the target is ready.
    SetUp,
    /// A field was computed.
    Solved,
    /// The field was checked. If it failed, more cycles or a costlier method follow, with phases of their own.
    Verified,
}

/// What an update did, and whether its field may be followed.
///
/// It speaks of this update alone: what an earlier one advised, or closed, holds until a full solve.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[must_use]
pub enum Verdict {
    /// The field is right: a full solve would change no direction that matters.
    Repaired,
    /// The field leads to the target from everywhere; a full solve would give better directions far away.
    RepairedAdviseFull,
    /// The change closed (or opened) a passage: do not call the field safe before a full solve.
    PassageClosed,
}

/// Solves fields. Keeps between solves what does not depend on the target, and patches it where cells changed.
#[derive(Debug, Default)]
pub struct Solver {
    settings: Settings,
    full: full::Full,
    repair: Repair,
}

impl Solver {
    /// A solver that has prepared nothing yet.
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
            full::Task {
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
            full::Task {
                settings: &self.settings,
                domain,
                near: None,
                cancellation,
            },
            observe,
        )
    }

    /// Applies `changes` to `domain` and brings its `field` up to date: in a window around them, or by a full solve where
    /// the map is small or the window would be half of it.
    ///
    /// `field` may lag behind `domain`: what counts is whether it knows a changed cell as blocked or free. So when a field
    /// solved in the background is swapped in, update it with all changes since that solve began. Every local update is
    /// provisional, whatever its verdict: follow it by a full solve ([`solve_near`](Self::solve_near)) beside the live field.
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
        // By what the field knows, not by what the map was: a change may be reported twice.
        let news: Vec<Change> = changes
            .iter()
            .copied()
            .filter(|change| field.is_blocked(change.cell) != change.blocked)
            .collect();
        if news.is_empty() {
            return Ok(Verdict::Repaired);
        }
        if let Some(verdict) = self.repair.update(domain, field, &news) {
            return Ok(verdict);
        }
        *field = self.solve_near(domain, field, cancellation)?;
        Ok(Verdict::Repaired)
    }
}
