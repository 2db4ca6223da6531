//! The thread on which full solves run beside the live field.

use std::{
    io::{self, Write},
    os::{
        fd::{AsFd, BorrowedFd},
        unix::net::UnixStream,
    },
    sync::mpsc::{Receiver, Sender, channel},
    thread::JoinHandle,
};

use crate::{Cancellation, Domain, Field, SolveError, Solver, step::Job};

/// What became of a job.
#[derive(Debug)]
pub struct Solved {
    /// The job's number.
    pub number: u64,
    /// Its map, and the field of it.
    pub result: Result<(Domain, Field), SolveError>,
}

/// A solver on a thread of its own. Dropping it cancels what runs and waits for the thread.
#[derive(Debug)]
pub struct BesideSolver {
    jobs: Option<Sender<(Job, Cancellation)>>,
    results: Receiver<Solved>,
    done: UnixStream,
    running: Cancellation,
    thread: Option<JoinHandle<()>>,
}

impl BesideSolver {
    /// Start the thread.
    ///
    /// # Errors
    /// When the system has no thread or descriptor left.
    pub fn start() -> io::Result<Self> {
        let (jobs, taken) = channel::<(Job, Cancellation)>();
        let (give, results) = channel();
        let (done, mut ring) = UnixStream::pair()?;
        done.set_nonblocking(true)?;
        // A full pipe has rung already.
        ring.set_nonblocking(true)?;
        let work = move || {
            let mut solver = Solver::default();
            for (job, cancellation) in taken {
                let Job { number, domain, .. } = job;
                let result = solver
                    .solve(&domain, &cancellation)
                    .map(|field| (domain, field));
                if give.send(Solved { number, result }).is_err() {
                    return;
                }
                let _ = ring.write(&[1]);
            }
        };
        let thread = std::thread::Builder::new()
            .name("full-solve".to_owned())
            .spawn(work)?;
        Ok(Self {
            jobs: Some(jobs),
            results,
            done,
            running: Cancellation::new(),
            thread: Some(thread),
        })
    }

    /// Begin `job`; one that still runs is stale and cancelled.
    pub fn begin(&mut self, job: Job) {
        self.running.cancel();
        self.running = Cancellation::new();
        if let Some(jobs) = &self.jobs {
            // The thread ends only when this is dropped.
            let _ = jobs.send((job, self.running.clone()));
        }
    }

    /// The next result, if there is one.
    pub fn take(&mut self) -> Option<Solved> {
        self.silence();
        self.results.try_recv().ok()
    }

    /// The next result; waits for it. None when the thread is gone.
    pub fn wait(&mut self) -> Option<Solved> {
        let solved = self.results.recv().ok();
        self.silence();
        solved
    }

    fn silence(&self) {
        use std::io::Read;
        let mut rung = [0; 64];
        while matches!((&self.done).read(&mut rung), Ok(read) if read > 0) {}
    }
}

/// Readable when a job is done.
impl AsFd for BesideSolver {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.done.as_fd()
    }
}

impl Drop for BesideSolver {
    fn drop(&mut self) {
        self.running.cancel();
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            // A panic there has been printed; the process ends anyway.
            let _ = thread.join();
        }
    }
}
