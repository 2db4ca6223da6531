//! The background solver: a thread on which full solves run while the live field stays in use.

use std::{
    io,
    os::fd::{AsFd, BorrowedFd},
    time::Instant,
};

use harmonic::{Cancellation, Field, Solver};

use crate::{
    background::Background,
    scheduling,
    step::{Job, Solved},
};

/// What the thread is given.
#[derive(Debug)]
pub(crate) struct Order {
    pub(crate) job: Job,
    pub(crate) cancellation: Cancellation,
    /// Do not start from the field before: whether that was finished is a matter of timing.
    pub(crate) afresh: bool,
}

/// A solver on a thread of its own. Dropping it cancels what runs and waits for the thread.
#[derive(Debug)]
pub struct BackgroundSolver {
    running: Cancellation,
    /// The job whose result was not taken yet.
    untaken: Option<u64>,
    thread: Background<Order, Solved>,
}

impl BackgroundSolver {
    /// Start the thread.
    ///
    /// # Errors
    /// When the system has no thread or descriptor left.
    pub fn start() -> io::Result<Self> {
        let mut worker = Worker::default();
        let solve = move |order| worker.solve(order);
        Ok(Self {
            running: Cancellation::new(),
            untaken: None,
            thread: Background::start("full-solve", scheduling::behind_stages, solve)?,
        })
    }

    /// Begin `job`; one that still runs is stale and cancelled.
    pub fn begin(&mut self, job: Job) {
        self.running.cancel();
        self.running = Cancellation::new();
        let afresh = self.untaken.replace(job.number).is_some();
        self.thread.begin(Order {
            job,
            cancellation: self.running.clone(),
            afresh,
        });
    }

    /// The next result, if there is one.
    pub fn take(&mut self) -> Option<Solved> {
        let solved = self.thread.take();
        self.taken(solved)
    }

    /// The next result; waits for it. None when the thread has ended.
    pub fn wait(&mut self) -> Option<Solved> {
        let solved = self.thread.wait();
        self.taken(solved)
    }

    fn taken(&mut self, solved: Option<Solved>) -> Option<Solved> {
        if let Some(solved) = &solved {
            self.untaken.take_if(|untaken| *untaken == solved.number);
        }
        solved
    }
}

/// The thread's own: a solver with its set-up, and the field solved last, where the next one starts.
#[derive(Default)]
pub(crate) struct Worker {
    solver: Solver,
    last: Option<Field>,
}

impl Worker {
    pub(crate) fn solve(&mut self, order: Order) -> Solved {
        let Order {
            job: Job { number, domain, .. },
            cancellation,
            afresh,
        } = order;
        let began = Instant::now();
        let last = self.last.take().filter(|_| !afresh);
        let solved = match &last {
            Some(near) => self.solver.solve_near(&domain, near, &cancellation),
            None => self.solver.solve(&domain, &cancellation),
        };
        if let Ok(field) = &solved {
            self.last = Some(field.clone());
        }
        Solved {
            number,
            result: solved.map(|field| Box::new((domain, field))),
            took_ns: began.elapsed().as_nanos() as u64,
        }
    }
}

/// Readable when a job is done.
impl AsFd for BackgroundSolver {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.thread.as_fd()
    }
}

impl Drop for BackgroundSolver {
    fn drop(&mut self) {
        self.running.cancel();
    }
}
