//! The recorder of a run: a consumer in a process of its own, without which the mission goes on.

use std::{fs::File, process::Stdio, time::Duration};

use common::{clock::Pace, poll};
use mission_control::Options;
use processes::process::{Process, firsthand};

use crate::commands::record::DiskBudget;

/// Waiting for the recorder takes milliseconds for either, and seconds beside 30 busy processes a core.
#[derive(Clone, Copy)]
struct Patience {
    /// A recorder that attaches later misses the beginning.
    attached: Duration,
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
    /// Waits until the recorder is attached. None if it cannot be started, which is logged.
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

    /// It writes the rest at the end of the run.
    pub(crate) fn end(mut self) {
        self.process.end(self.patience.ended);
    }
}
