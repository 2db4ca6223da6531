//! The recorder that `firsthand run` starts: a consumer in a process of its own. Whatever becomes of it, the mission goes
//! on.

use std::{fs::File, process::Stdio, time::Duration};

use common::poll;
use supervisor::{
    Options,
    process::{Process, firsthand},
};

/// A recorder that has not attached by then misses the beginning.
const ATTACHED_WITHIN: Duration = Duration::from_secs(2);
/// To write its last chunk it takes some milliseconds.
const ENDED_WITHIN: Duration = Duration::from_secs(5);

/// The recorder of one run.
pub(crate) struct RunRecorder {
    process: Process,
}

impl RunRecorder {
    /// Start it, and wait until it is attached. None where it cannot be started, which is logged.
    pub(crate) fn start(options: &Options) -> Option<Self> {
        match Self::spawn(options) {
            Ok(recorder) => Some(recorder),
            Err(error) => {
                tracing::error!(%error, "nothing is recorded");
                None
            }
        }
    }

    fn spawn(options: &Options) -> std::io::Result<Self> {
        let directory = &options.directory;
        let log = File::options()
            .create(true)
            .append(true)
            .open(directory.join("recorder.log"))?;
        let mut command = firsthand(&["record", "--robot", &options.robot.to_string()]);
        // Not over the recording of a run that is resumed.
        let free = recording::places(directory).find(|file| !file.exists());
        command.arg("--out").args(free);
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

    /// The run is over: let it write the rest.
    pub(crate) fn end(mut self) {
        self.process.end(ENDED_WITHIN);
    }
}
