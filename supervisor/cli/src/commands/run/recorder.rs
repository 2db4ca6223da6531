//! The recorder that `firsthand run` starts: a consumer in a process of its own. The mission goes on without it too.

use std::{fs::File, process::Stdio, time::Duration};

use common::poll;
use supervisor::{
    Options,
    process::{Process, firsthand},
};

use crate::commands::record::DiskBudget;

/// The time within which the recorder must be attached, or it misses the beginning. It takes milliseconds, and seconds beside 30 busy
/// processes a core.
const ATTACHED_WITHIN: Duration = Duration::from_secs(20);
/// The time for the recorder's last chunks, which take as long.
const ENDED_WITHIN: Duration = Duration::from_secs(60);

pub(crate) struct RunRecorder {
    process: Process,
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
        let said = process.take_stdout();
        let attached = match &said {
            Some(said) => poll::is_readable(said, ATTACHED_WITHIN)?,
            None => false,
        };
        if !attached {
            tracing::warn!(
                "the recorder is not attached yet; what is published now is not recorded"
            );
        }
        Ok(Self { process })
    }

    /// Let the recorder write the rest at the end of the run.
    pub(crate) fn end(mut self) {
        self.process.end(ENDED_WITHIN);
    }
}
