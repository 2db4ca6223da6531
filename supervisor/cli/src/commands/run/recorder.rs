//! The recorder of a run: a consumer in a process of its own, without which the mission goes on.

use std::{fs::File, io, os::fd::AsFd as _, process::Stdio, time::Duration};

use common::{clock::Pace, poll, signals::Signals};
use mission_control::Options;
use processes::process::{Process, firsthand};

use crate::commands::record::DiskBudget;

/// Waiting for the recorder takes milliseconds, and seconds beside 30 busy processes a core. These are the most seconds until it
/// is attached, because one that attaches later misses the beginning, and until it has ended. A robot and the service manager
/// wait for a run on a wall clock, nobody for one in lockstep. A calibration is nothing without its recording.
const fn patience(options: &Options) -> [Duration; 2] {
    let [attached, ended] = match (options.pace, &options.mission.planner.calibration) {
        (Pace::Rate(_), None) => [2, 5],
        _ => [20, 60],
    };
    [Duration::from_secs(attached), Duration::from_secs(ended)]
}

pub(crate) struct RunRecorder {
    process: Process,
    ends_within: Duration,
}

impl RunRecorder {
    /// Waits until the recorder is attached, or one of `signals` comes. None if it cannot be started, which is logged.
    pub(crate) fn start(
        options: &Options,
        budget: Option<DiskBudget>,
        signals: &Signals,
    ) -> Option<Self> {
        Self::spawn(options, budget, signals)
            .inspect_err(|error| tracing::error!(%error, "nothing is recorded"))
            .ok()
    }

    fn spawn(options: &Options, budget: Option<DiskBudget>, signals: &Signals) -> io::Result<Self> {
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
        let [attached_within, ends_within] = patience(options);
        let said = process.take_stdout().ok_or(io::ErrorKind::BrokenPipe)?;
        let awaited = [said.as_fd(), signals.as_fd()];
        let attached = poll::readable(&awaited, Some(attached_within))?.first() == Some(&true);
        if !attached {
            tracing::warn!(
                "the recorder is not attached yet; what is published now is not recorded"
            );
        }
        // One that is stopped before it is attached has recorded nothing.
        let ends_within = if attached || !signals.pending() { ends_within } else { Duration::ZERO };
        Ok(Self { process, ends_within })
    }
}

/// It writes the rest at the end of the run.
impl Drop for RunRecorder {
    fn drop(&mut self) {
        self.process.end(self.ends_within);
    }
}
