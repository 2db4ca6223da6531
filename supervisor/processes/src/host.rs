//! What starts and watches the stages' processes: the system, or a simulated machine.

use std::{
    io,
    os::fd::{AsFd as _, BorrowedFd},
    path::{Path, PathBuf},
    process::Stdio,
    time::Duration,
};

use common::{file::append, start::Generation};
use rustix::process::Signal;

use crate::{
    activity::{Activity, Times},
    death::log_tail,
    process::{self, ExitCause, Process},
};

pub trait Watched {
    fn id(&self) -> u32;

    fn signal(&self, signal: Signal);

    fn try_reap(&mut self) -> io::Result<Option<ExitCause>>;

    /// By force after `grace`.
    fn end(&mut self, grace: Duration);

    /// Returns what becomes readable at the end of the process; none on a simulated machine.
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        None
    }

    /// Returns the times that the process ran and starved; `None` if it has ended or is not
    /// counted.
    fn times(&self) -> Option<Times> {
        Times::of(self.id())
    }

    fn activity(&self, then: Times) -> Option<Activity> {
        then.activity(self.id())
    }

    /// Returns the end of what the process has logged, in whole lines.
    fn log_tail(&self) -> String {
        String::new()
    }
}

pub trait Host {
    /// A mission may name another `executable`.
    fn start(
        &mut self,
        executable: Option<&Path>,
        generation: &Generation,
    ) -> io::Result<Box<dyn Watched>>;

    /// Watches the process `id` that somebody else has started as `stage`.
    fn adopt(&mut self, id: u32, stage: &str) -> io::Result<Box<dyn Watched>>;
}

/// The system. Stages log to the run directory.
pub struct System {
    pub directory: PathBuf,
}

impl System {
    fn log(&self, stage: &str) -> PathBuf {
        self.directory.join(format!("{stage}.log"))
    }
}

struct SystemProcess {
    process: Process,
    log: PathBuf,
    /// Length of the log before this process.
    log_start: u64,
}

impl Host for System {
    fn start(
        &mut self,
        executable: Option<&Path>,
        generation: &Generation,
    ) -> io::Result<Box<dyn Watched>> {
        let log = self.log(generation.stage);
        let log_start = log.metadata().map_or(0, |log| log.len());
        let named =
            |error: io::Error| io::Error::new(error.kind(), format!("{}: {error}", log.display()));
        let output = append(&log).map_err(named)?;
        let mut command = process::stage(executable, generation);
        command.stdout(Stdio::null()).stderr(output);
        Ok(Box::new(SystemProcess { process: Process::spawn(command)?, log, log_start }))
    }

    fn adopt(&mut self, id: u32, stage: &str) -> io::Result<Box<dyn Watched>> {
        let (process, log) = (Process::adopt(id, stage)?, self.log(stage));
        Ok(Box::new(SystemProcess { process, log, log_start: 0 }))
    }
}

impl Watched for SystemProcess {
    fn id(&self) -> u32 {
        self.process.id()
    }

    fn signal(&self, signal: Signal) {
        self.process.signal(signal);
    }

    fn try_reap(&mut self) -> io::Result<Option<ExitCause>> {
        self.process.try_reap()
    }

    fn end(&mut self, grace: Duration) {
        self.process.end(grace);
    }

    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        Some(self.process.as_fd())
    }

    fn log_tail(&self) -> String {
        log_tail(&self.log, self.log_start)
    }
}
