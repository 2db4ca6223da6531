//! The recorder that `firsthand run` starts: a consumer in a process of its own. The mission goes on without it too.

use std::{fs::File, process::Stdio, time::Duration};

use common::{clock::Pace, poll};
use mission_control::Options;
use processes::process::{Process, firsthand};

use crate::commands::record::DiskBudget;

/// How long a run waits for its recorder, which takes milliseconds for either, and seconds beside 30 busy processes a core.
#[derive(Clone, Copy)]
struct Patience {
    /// Until it is attached, or it misses the beginning.
    attached: Duration,
    /// Until its last chunks are written.
    ended: Duration,
}

impl Patience {
    /// A robot and the service manager wait for a run on a wall clock, nobody for one in lockstep.
    const fn at(pace: Pace) -> Self {
        let (attached, ended) = match pace {
            Pace::Max => (20, 60),
            Pace::Rate(_) => (2, 5),
        };
        Self { attached: Duration::from_secs(attached), ended: Duration::from_secs(ended) }
    }
}

pub(crate) struct RunRecorder {
    process: Process,
    patience: Patience,
}

impl RunRecorder {
    /// Start a recorder with this budget for its files, and wait until it is attached. None if it cannot be started, which is
    /// logged.
    pub(crate) fn start(options: &Options, budget: Option<DiskBudget>) -> Option<Self> {
        match Self::spawn(options, budget) {
            Ok(recorder) => Some(recorder),
            Err(error) => {
                tracing::error!(%error, "nothing is recorded");
                None
            }
        }
    }

    fn spawn(options: &Options, budget: Option<DiskBudget>) -> std::io::Result<Self> {
        let directory = &options.directory;
        let log = File::options().create(true).append(true).open(directory.join("recorder.log"))?;
        let mut command = firsthand(&["record", "--robot", &options.robot.to_string()]);
        // A resumed run may have a recording already.
        command.arg("--out").arg(recording::next_place(directory));
        if let Some(DiskBudget(bytes)) = budget {
            command.args(["--disk-budget", &bytes.to_string()]);
        }
        command.arg("--run-directory").arg(directory);
        command.args(["--supervisor", &std::process::id().to_string()]);
        command.stdout(Stdio::piped()).stderr(log);
        let mut process = Process::spawn(command)?;
        let patience = Patience::at(options.pace);
        let said = process.take_stdout();
        let attached = match &said {
            Some(said) => poll::is_readable(said, patience.attached)?,
            None => false,
        };
        if !attached {
            tracing::warn!(
                "the recorder is not attached yet; what is published now is not recorded"
            );
        }
        Ok(Self { process, patience })
    }

    /// Let the recorder write the rest at the end of the run.
    pub(crate) fn end(mut self) {
        self.process.end(self.patience.ended);
    }
}
