//! The background solver solves the newest map while the robot follows the field before.

use std::{
    io,
    os::fd::{AsFd, BorrowedFd},
    sync::Arc,
    time::Instant,
};

use harmonic::{Cancellation, Field, Solver};

use crate::{
    background::Background,
    step::{Job, Solved},
};

/// Dropping this cancels the running solve and waits for the thread.
#[derive(Debug)]
pub struct BackgroundSolver {
    cancellation: Cancellation,
    thread: Background<Job, Solved>,
}

impl BackgroundSolver {
    /// Fails when the system gives no pipe or thread.
    pub fn start() -> io::Result<Self> {
        let mut worker = Worker::default();
        let cancellation = worker.cancellation.clone();
        let solve = move |job| worker.solve(job);
        Ok(Self { cancellation, thread: Background::start("full-solve", solve)? })
    }

    pub fn begin(&mut self, job: Job) {
        self.thread.begin(job);
    }

    pub fn take(&mut self) -> Option<Solved> {
        self.thread.take()
    }

    /// Waits for it. None when the thread has ended.
    pub fn wait(&mut self) -> Option<Solved> {
        self.thread.wait()
    }
}

/// A solve starts from the field before.
#[derive(Default)]
pub(crate) struct Worker {
    solver: Solver,
    cancellation: Cancellation,
    last: Option<Arc<Field>>,
}

impl Worker {
    pub(crate) fn solve(&mut self, Job { number, domain }: Job) -> Solved {
        let began = Instant::now();
        let field = match &self.last {
            Some(near) => self.solver.solve_near(&domain, near, &self.cancellation),
            None => self.solver.solve(&domain, &self.cancellation),
        };
        let field = field.map(Arc::new);
        self.last = field.as_ref().ok().cloned();
        Solved { number, field, took_ns: began.elapsed().as_nanos() as u64 }
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
        self.cancellation.cancel();
    }
}
