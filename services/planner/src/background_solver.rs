//! The background solver: a thread on which full solves run while the live field stays in use.

use std::{
    io::{self, Write},
    os::{
        fd::{AsFd, BorrowedFd},
        unix::net::UnixStream,
    },
    sync::mpsc::{Receiver, Sender, channel},
    thread::JoinHandle,
    time::Instant,
};

use harmonic::{Cancellation, Field, Solver};

use crate::step::{Job, Solved};

/// Niceness of the thread: the stages that answer the robot's ticks go first.
const NICE: i32 = 10;

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
    jobs: Option<Sender<Order>>,
    results: Receiver<Solved>,
    done: UnixStream,
    running: Cancellation,
    /// The job whose result was not taken yet.
    untaken: Option<u64>,
    thread: Option<JoinHandle<()>>,
}

impl BackgroundSolver {
    /// Start the thread.
    ///
    /// # Errors
    /// When the system has no thread or descriptor left.
    pub fn start() -> io::Result<Self> {
        let (jobs, orders) = channel::<Order>();
        let (finished, results) = channel();
        let (done, mut wakeup) = UnixStream::pair()?;
        done.set_nonblocking(true)?;
        // A full pipe is readable already.
        wakeup.set_nonblocking(true)?;
        let work = move || {
            // Where that is refused they share the processor.
            let _ = rustix::process::nice(NICE);
            let mut worker = Worker::default();
            for order in orders {
                if finished.send(worker.solve(order)).is_err() {
                    return;
                }
                let _ = wakeup.write(&[1]);
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
            untaken: None,
            thread: Some(thread),
        })
    }

    /// Begin `job`; one that still runs is stale and cancelled.
    pub fn begin(&mut self, job: Job) {
        self.running.cancel();
        self.running = Cancellation::new();
        let afresh = self.untaken.replace(job.number).is_some();
        if let Some(jobs) = &self.jobs {
            // The thread ends only when this is dropped.
            let _ = jobs.send(Order {
                job,
                cancellation: self.running.clone(),
                afresh,
            });
        }
    }

    /// The next result, if there is one.
    pub fn take(&mut self) -> Option<Solved> {
        self.drain();
        let solved = self.results.try_recv().ok();
        self.taken(solved)
    }

    /// The next result; waits for it. None when the thread has ended.
    pub fn wait(&mut self) -> Option<Solved> {
        let solved = self.results.recv().ok();
        self.drain();
        self.taken(solved)
    }

    fn taken(&mut self, solved: Option<Solved>) -> Option<Solved> {
        if let Some(solved) = &solved {
            self.untaken.take_if(|untaken| *untaken == solved.number);
        }
        solved
    }

    fn drain(&self) {
        use std::io::Read;
        let mut wakeups = [0; 64];
        while matches!((&self.done).read(&mut wakeups), Ok(read) if read > 0) {}
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
        self.done.as_fd()
    }
}

impl Drop for BackgroundSolver {
    fn drop(&mut self) {
        self.running.cancel();
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            // A panic there has been printed; the process ends anyway.
            let _ = thread.join();
        }
    }
}
