//! A thread that does one job after the other beside the tick.

use std::{
    io::{self, Read as _, Write as _},
    os::{
        fd::{AsFd, BorrowedFd},
        unix::net::UnixStream,
    },
    sync::mpsc::{Receiver, Sender, channel},
    thread::JoinHandle,
};

/// The thread. Dropping it waits for the job that runs.
#[derive(Debug)]
pub(crate) struct Background<Job, Done> {
    jobs: Option<Sender<Job>>,
    results: Receiver<Done>,
    done: UnixStream,
    /// Jobs whose end has not been read from `done` yet.
    unread: u64,
    thread: Option<JoinHandle<()>>,
}

impl<Job: Send + 'static, Done: Send + 'static> Background<Job, Done> {
    /// Start the thread `name`, which first does `prepare`.
    pub(crate) fn start(
        name: &str,
        prepare: fn(),
        mut work: impl FnMut(Job) -> Done + Send + 'static,
    ) -> io::Result<Self> {
        let (jobs, orders) = channel::<Job>();
        let (finished, results) = channel();
        let (done, mut wakeup) = UnixStream::pair()?;
        done.set_nonblocking(true)?;
        // A full pipe is readable already.
        wakeup.set_nonblocking(true)?;
        let all = move || {
            prepare();
            for job in orders {
                if finished.send(work(job)).is_err() {
                    return;
                }
                let _ = wakeup.write(&[1]);
            }
        };
        let thread = std::thread::Builder::new()
            .name(name.to_owned())
            .spawn(all)?;
        Ok(Self {
            jobs: Some(jobs),
            results,
            done,
            unread: 0,
            thread: Some(thread),
        })
    }

    /// Have `job` done, after those before it.
    pub(crate) fn begin(&mut self, job: Job) {
        if let Some(jobs) = &self.jobs {
            // The thread ends only when this is dropped.
            let _ = jobs.send(job);
            self.unread += 1;
        }
    }

    pub(crate) fn take(&mut self) -> Option<Done> {
        self.drain();
        self.results.try_recv().ok()
    }

    /// The next result; waits for it. None when the thread has ended.
    pub(crate) fn wait(&mut self) -> Option<Done> {
        let result = self.results.recv().ok();
        self.drain();
        result
    }

    fn drain(&mut self) {
        let mut wakeups = [0; 64];
        // Without a job the system call is saved.
        while self.unread > 0 {
            match self.done.read(&mut wakeups) {
                Ok(read @ 1..) => self.unread = self.unread.saturating_sub(read as u64),
                _ => return,
            }
        }
    }
}

/// Readable when a job is done.
impl<Job, Done> AsFd for Background<Job, Done> {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.done.as_fd()
    }
}

impl<Job, Done> Drop for Background<Job, Done> {
    fn drop(&mut self) {
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            // A panic there has been printed; the process ends anyway.
            let _ = thread.join();
        }
    }
}
