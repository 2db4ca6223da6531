//! Thread that runs jobs in order beside the tick; only the tick's thread has real-time priority.

use std::{
    collections::VecDeque,
    io::{self, Read as _, Write as _},
    os::{
        fd::{AsFd, BorrowedFd},
        unix::net::UnixStream,
    },
    sync::mpsc::{Receiver, Sender, channel},
    thread::JoinHandle,
};

use common::machine;
use harmonic::Cancellation;
use thread_priority::{
    NormalThreadSchedulePolicy as Normal, ThreadPriority, ThreadPriorityValue,
    ThreadSchedulePolicy, set_thread_priority_and_policy, thread_native_id,
};

/// Jobs beside the tick. A simulated machine has no threads: a job is done when it begins.
pub(crate) enum Background<Job, Done> {
    Thread(Thread<Job, Done>),
    Simulated(Box<dyn FnMut(Job) -> Done>, VecDeque<Done>),
}

/// Background thread; dropping it cancels the running job, if possible, and waits for it.
pub(crate) struct Thread<Job, Done> {
    jobs: Option<Sender<Job>>,
    results: Receiver<Done>,
    /// Holds a byte per result.
    done: UnixStream,
    thread: Option<JoinHandle<()>>,
    cancellation: Cancellation,
}

impl<Job: Send + 'static, Done: Send + 'static> Background<Job, Done> {
    /// Fails if the system gives no pipe or thread.
    pub(crate) fn start(
        name: &str,
        cancellation: Cancellation,
        mut work: impl FnMut(Job) -> Done + Send + 'static,
    ) -> io::Result<Self> {
        if machine::is_simulated() {
            return Ok(Self::Simulated(Box::new(work), VecDeque::new()));
        }
        let (jobs, orders) = channel::<Job>();
        let (finished, results) = channel();
        let (done, mut wakeup) = UnixStream::pair()?;
        done.set_nonblocking(true)?;
        // A full pipe is already readable.
        wakeup.set_nonblocking(true)?;
        let all = move || {
            behind_stages();
            for job in orders {
                if finished.send(work(job)).is_err() {
                    return;
                }
                let _ = wakeup.write(&[1]);
            }
        };
        let thread = std::thread::Builder::new().name(name.to_owned()).spawn(all)?;
        let (jobs, thread) = (Some(jobs), Some(thread));
        Ok(Self::Thread(Thread { jobs, results, done, thread, cancellation }))
    }

    pub(crate) fn begin(&mut self, job: Job) {
        match self {
            // The thread ends only when this value is dropped.
            Self::Thread(thread) => drop(thread.jobs.as_ref().map(|jobs| jobs.send(job))),
            Self::Simulated(work, done) => done.push_back(work(job)),
        }
    }

    /// Takes a result whose end was signalled.
    ///
    /// A signal that arrives after its result would wake the process forever.
    pub(crate) fn take(&mut self) -> Option<Done> {
        match self {
            Self::Thread(thread) => match thread.done.read(&mut [0]) {
                Ok(1) => thread.results.try_recv().ok(),
                _ => None,
            },
            Self::Simulated(_, done) => done.pop_front(),
        }
    }

    /// `None` after the thread has ended.
    pub(crate) fn wait(&mut self) -> Option<Done> {
        match self {
            Self::Thread(thread) => {
                let result = thread.results.recv().ok();
                // Its signal may come later and is then one too many, which only wakes the process.
                let _ = thread.done.read(&mut [0]);
                result
            }
            Self::Simulated(_, done) => done.pop_front(),
        }
    }
}

impl<Job, Done> Background<Job, Done> {
    /// Returns what becomes readable when a job is done, unless it is done at once.
    pub(crate) fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        match self {
            Self::Thread(thread) => Some(thread.done.as_fd()),
            Self::Simulated(..) => None,
        }
    }
}

impl<Job, Done> Drop for Thread<Job, Done> {
    fn drop(&mut self) {
        self.jobs = None;
        self.cancellation.cancel();
        if let Some(thread) = self.thread.take() {
            // The panic of the thread was printed, and the process ends anyway.
            let _ = thread.join();
        }
    }
}

/// Niceness 10 in [`ThreadPriority::Crossplatform`], where 99 is the highest priority.
const NICENESS_10: u8 = 22;

/// Reduces this thread to a tenth of a stage's share of a contended processor.
///
/// With SCHED_IDLE, the end of a killed process took seconds on a busy machine. Each of its threads
/// has to run first, while others wait for its kernel locks.
fn behind_stages() {
    let Ok(value) = ThreadPriorityValue::try_from(NICENESS_10) else {
        return;
    };
    let policy = ThreadSchedulePolicy::Normal(Normal::Other);
    let priority = ThreadPriority::Crossplatform(value);
    // If the system refuses, the threads share the processor equally.
    let _ = set_thread_priority_and_policy(thread_native_id(), priority, policy);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn after_its_result_was_taken_a_job_wakes_nobody() {
        for job in 0..200 {
            let mut background =
                Background::start("test", Cancellation::default(), |job: u32| job).unwrap();
            background.begin(job);
            let result = std::iter::repeat_with(|| background.take()).flatten().next();
            assert_eq!(result, Some(job));
            let Background::Thread(mut thread) = background else { unreachable!() };
            thread.jobs = None;
            thread.thread.take().unwrap().join().unwrap();
            let error = thread.done.read(&mut [0]).map_err(|error| error.kind());
            // The end of the thread is readable too, without a byte.
            assert!(matches!(error, Ok(0) | Err(io::ErrorKind::WouldBlock)), "{error:?}");
        }
    }

    #[test]
    fn niceness_10_is_10() {
        let value = ThreadPriorityValue::try_from(NICENESS_10).unwrap();
        let policy = ThreadSchedulePolicy::Normal(Normal::Other);
        assert_eq!(ThreadPriority::Crossplatform(value).to_posix(policy).unwrap(), 10);
    }
}
