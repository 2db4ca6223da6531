//! Solver that computes a verified field of a domain.
//!
//! It tries the method that [`plan()`] chooses, then costlier ones.

mod plan;

use std::{num::NonZeroUsize, ops::Range};

use crate::{
    Cancellation, Domain, Field, Method, SolveError,
    multifrontal::{self, Job, Ordered, Workspace},
    multigrid::{DOUBLE_CYCLES, FIRST_CHECK, Multigrid, SINGLE_CYCLES},
    multigrid_bands,
    real::Real,
    store::{BLOCKED, Store},
    verification::{self, Check},
};

use plan::{beyond_single, plan};

/// Cycles before the first check of a solve from a similar field; the first cycle has no
/// correction.
const FIRST_CHECK_NEAR: usize = 2;

/// Cycle limit of a solve that starts from a similar field, before a solve from scratch.
///
/// Maps that exceed it mostly have newly cut-off cells. Their u falls by an order of magnitude per
/// cycle, while a solve from scratch starts at zero.
const NEAR_CYCLES: usize = 20;

/// Resources of a solver.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Threads that a solve may use; the result is the same to the bit for every number.
    ///
    /// Only the verification of large maps uses more than one.
    pub threads: NonZeroUsize,
    /// Memory for the multifrontal factorisation, in bytes.
    ///
    /// A solve that depends on a larger factorisation ends in [`SolveError::TooCostly`].
    pub memory_limit: u64,
}

impl Default for Settings {
    /// Returns one thread and 2 GiB.
    fn default() -> Self {
        Self { threads: NonZeroUsize::MIN, memory_limit: 2 << 30 }
    }
}

/// Solver of fields.
///
/// Between solves it keeps the target-independent set-up and updates it where cells changed.
#[derive(Debug, Default)]
pub struct Solver {
    settings: Settings,
    single: Prepared<f32>,
    double: Prepared<f64>,
    multifrontal: Workspace,
}

impl Solver {
    /// Creates a solver without a set-up.
    pub fn new(settings: Settings) -> Self {
        Self { settings, ..Self::default() }
    }

    /// Solves `domain` and verifies the field.
    ///
    /// # Errors
    /// - [`SolveError::Cancelled`] after [`Cancellation::cancel`].
    /// - [`SolveError::TooCostly`] if the last method needs more memory than
    ///   [`Settings::memory_limit`].
    /// - [`SolveError::Unverified`] if the field of every method fails verification.
    pub fn solve(
        &mut self,
        domain: &Domain,
        cancellation: &Cancellation,
    ) -> Result<Field, SolveError> {
        self.run(domain, None, cancellation)
    }

    /// Solves `domain` from the field of a similar map, which saves most multigrid cycles.
    ///
    /// A field of another map size or target is ignored.
    ///
    /// # Errors
    /// See [`solve`](Self::solve).
    pub fn solve_near(
        &mut self,
        domain: &Domain,
        near: &Field,
        cancellation: &Cancellation,
    ) -> Result<Field, SolveError> {
        self.run(domain, Some(near), cancellation)
    }

    /// Returns the number of multigrid cycles of all solves so far, a measure of their work.
    pub fn cycles(&self) -> usize {
        self.single.levels.cycles + self.double.levels.cycles
    }
}

struct Task<'a> {
    threads: NonZeroUsize,
    job: Job<'a>,
}

impl Task<'_> {
    fn check(&self, store: &Store) -> Check {
        verification::check(self.job.domain, store, self.threads)
    }
}

type Solved = (Store, Check, Method);

#[derive(Debug, Default)]
pub(super) struct Prepared<R> {
    levels: Multigrid<R>,
    width: usize,
    blocked: Vec<bool>,
    screening: f64,
    costs: Vec<f32>,
}

impl Solver {
    fn run(
        &mut self,
        domain: &Domain,
        near: Option<&Field>,
        cancellation: &Cancellation,
    ) -> Result<Field, SolveError> {
        let Settings { threads, memory_limit } = self.settings;
        cancellation.check()?;
        let job = Job::new(domain, memory_limit, cancellation);
        let task = Task { threads, job };
        if let Some(near) = near.filter(|near| near.fits(domain)) {
            let method = near.verification().method;
            // The shape of the map alone decides the cost of the factorisation, so the usual plan
            // applies.
            if method != Method::Multifrontal {
                let (store, check, method) = self.multigrid(method, Some(near), &task)?;
                if check.holds() {
                    return Ok(Field::new(domain, store, &check, method));
                }
            }
        }
        let mut ordered = plan(job)?;
        // Unless it was planned, the factorisation is the last resort.
        let methods: &[_] = match ordered {
            Some(_) => &[Method::Multifrontal],
            None => &[Method::MultigridSingle, Method::MultigridDouble, Method::Multifrontal],
        };
        let mut failed = Check::default();
        for &method in methods {
            let (store, check, method) = match method {
                Method::Multifrontal => self.multifrontal(ordered.take(), &task)?,
                method => self.multigrid(method, None, &task)?,
            };
            if check.holds() {
                return Ok(Field::new(domain, store, &check, method));
            }
            failed = check;
        }
        Err(SolveError::Unverified {
            worst_residual: failed.worst_residual,
            local_maxima: failed.local_maxima + failed.unreached,
        })
    }

    fn multifrontal(
        &mut self,
        planned: Option<Ordered>,
        task: &Task<'_>,
    ) -> Result<Solved, SolveError> {
        let job = task.job;
        let ordered = match planned {
            Some(ordered) => ordered,
            None => multifrontal::order(job)?,
        };
        let mut store = multifrontal::solve(job, &ordered, None, &mut self.multifrontal)?;
        let mut check = task.check(&store);
        if !check.holds() {
            store = multifrontal::relax(job.domain, &ordered.0, &store);
            check = task.check(&store);
        }
        Ok((store, check, Method::Multifrontal))
    }

    /// Solves by multigrid, in double precision if `method` says so.
    ///
    /// Where u falls below the range of single precision, the cheaper of two methods continues:
    /// multifrontal factorisation of the passages, or multigrid in bands.
    fn multigrid(
        &mut self,
        method: Method,
        near: Option<&Field>,
        task: &Task<'_>,
    ) -> Result<Solved, SolveError> {
        let job = task.job;
        if method == Method::MultigridDouble {
            let (store, check) = self.double.solve(task, near, DOUBLE_CYCLES)?;
            return Ok((store, check, method));
        }
        let (store, check) = self.single.solve(task, near, SINGLE_CYCLES)?;
        if check.holds() || check.unreached == 0 {
            return Ok((store, check, Method::MultigridSingle));
        }
        let (store, method) = if let Some(ordered) = beyond_single(job, &store)? {
            let known = Some(&store);
            let store = multifrontal::solve(job, &ordered, known, &mut self.multifrontal)?;
            (store, Method::MultigridAndMultifrontal)
        } else {
            // The bands overwrite the levels, so the next solve sets them up again.
            self.single.width = 0;
            let levels = &mut self.single.levels;
            let store = multigrid_bands::solve(job.domain, store, levels, job.cancellation)?;
            (store, Method::MultigridBands)
        };
        let check = task.check(&store);
        Ok((store, check, method))
    }
}

impl<R: Real> Prepared<R>
where
    Store: From<Vec<R>>,
{
    /// Runs cycles, from `near` if given, until convergence or the cycle limit, which is
    /// `most_cycles` from scratch.
    fn solve(
        &mut self,
        task: &Task<'_>,
        near: Option<&Field>,
        most_cycles: usize,
    ) -> Result<(Store, Check), SolveError> {
        let (threads, Job { domain, cancellation, .. }) = (task.threads, task.job);
        let levels = self.prepare(domain);
        let cycles = match near {
            Some(near) => {
                let width = domain.width();
                levels.start_near(domain.target(), |row, guess| {
                    let cells = row * width..(row + 1) * width;
                    near.store.read_row_as(cells, -R::TOP, guess);
                });
                (FIRST_CHECK_NEAR, NEAR_CYCLES)
            }
            None => {
                levels.start(domain.target());
                (FIRST_CHECK, most_cycles)
            }
        };
        let mut found = (Store::from(Vec::new()), Check::default());
        levels.converge(cycles, cancellation, |levels| {
            levels.finish();
            let values = levels.read(domain.target(), R::of(BLOCKED));
            assert_eq!(values.len(), domain.blocked().len());
            let store = Store::from(values);
            let check = task.check(&store);
            let mut excess = check.excess();
            if check.unreached > 0 {
                // u falls below the range of this precision, so the check covers only the cells
                // above it.
                excess = verification::check_above(domain, &store, threads, R::KNOWN).excess();
            }
            found = (store, check);
            (!check.holds() && (check.unreached == 0 || excess > 1.0)).then_some(excess)
        })?;
        Ok(found)
    }

    fn prepare(&mut self, domain: &Domain) -> &mut Multigrid<R> {
        let (width, height) = (domain.width(), domain.height());
        let same_size = self.width == width && self.blocked.len() == domain.blocked().len();
        let changed = if same_size && self.screening == domain.screening_coefficient() {
            self.changed_rows(domain)
        } else {
            Some(0..height)
        };
        if !same_size {
            self.levels.reshape(width, height);
        }
        if let Some(rows) = changed {
            self.levels.set_up_rows(domain, rows);
            self.width = width;
            self.screening = domain.screening_coefficient();
            domain.blocked().clone_into(&mut self.blocked);
            domain.costs().clone_into(&mut self.costs);
        }
        &mut self.levels
    }

    fn changed_rows(&self, domain: &Domain) -> Option<Range<usize>> {
        let width = domain.width();
        let differs = |row: &usize| {
            let cells = row * width..(row + 1) * width;
            self.blocked[cells.clone()] != domain.blocked()[cells.clone()]
                || self.costs.get(cells.clone()) != domain.costs().get(cells)
        };
        let mut rows = (0..domain.height()).filter(differs);
        let first = rows.next()?;
        Some(first..rows.next_back().unwrap_or(first) + 1)
    }
}
