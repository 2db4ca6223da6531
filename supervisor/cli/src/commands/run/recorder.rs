//! Recorder of a run in its own process, optional for the mission.

use std::{
    io::{self, Read as _, Write as _},
    os::fd::AsFd as _,
    process::{ChildStdin, ChildStdout, Stdio},
    time::Duration,
};

use common::{file::append, mission::Mission, poll, signals::Signals};
use mission_control::{Consumer, Options};
use processes::process::{Process, firsthand};

use crate::commands::record::DiskBudget;

/// Returns the waits for the recorder to attach, catch up and end, milliseconds. The recorder needs
/// milliseconds, or seconds beside 30 busy processes per core.
///
/// Short for a real robot, long for a simulated one, and for a calibration, which needs its
/// recording.
const fn patience_ms(Mission { robot, planner, .. }: &Mission) -> [u64; 3] {
    match (&robot.address, &planner.calibration) {
        (Some(_), None) => [2_000, 500, 5_000],
        _ => [20_000, 20_000, 60_000],
    }
}

pub struct RunRecorder<'a> {
    options: &'a Options,
    budget: Option<DiskBudget>,
    /// Longest times that a run waits. A recorder that attaches later misses the beginning.
    attached: Duration,
    caught_up: Duration,
    ended: Duration,
    process: Option<Process>,
    /// Pipes for catch-up requests. `None` after a missing answer.
    pipes: Option<(ChildStdin, ChildStdout)>,
}

impl<'a> RunRecorder<'a> {
    pub fn new(options: &'a Options, budget: Option<DiskBudget>) -> Self {
        let [attached, caught_up, ended] = patience_ms(&options.mission).map(Duration::from_millis);
        Self { options, budget, attached, caught_up, ended, process: None, pipes: None }
    }

    fn spawn(&self) -> io::Result<Process> {
        let Options { directory, robot, .. } = self.options;
        let log = append(directory.join("recorder.log"))?;
        let mut command = firsthand(&["record", "--robot", &robot.to_string()]);
        // A resumed run may already have a recording.
        command.arg("--out").arg(recording::next_place(directory));
        if let Some(DiskBudget(bytes)) = self.budget {
            command.args(["--disk-budget", &bytes.to_string()]);
        }
        command.arg("--run-directory").arg(directory);
        command.args(["--supervisor", &std::process::id().to_string()]);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(log);
        Process::spawn(command)
    }

    /// Returns whether any came.
    fn hear(&mut self, within: Duration, signals: &Signals) -> io::Result<bool> {
        let Some((_, said)) = &mut self.pipes else {
            return Ok(false);
        };
        let heard = poll::readable(&[said.as_fd(), signals.as_fd()], Some(within))?;
        // An ended recorder leaves nothing to read.
        Ok(heard.first() == Some(&true) && said.read(&mut [0; 4096])? > 0)
    }
}

impl Consumer for RunRecorder<'_> {
    /// A failure is only logged.
    fn attach(&mut self, signals: &Signals) {
        let attached = self.spawn().and_then(|mut process| {
            self.pipes = process.take_stdin().zip(process.take_stdout());
            self.process = Some(process);
            self.hear(self.attached, signals)
        });
        match attached {
            Ok(true) => {}
            Ok(false) => {
                tracing::warn!(
                    "the recorder is not attached yet; what is published now is not recorded"
                );
                // A recorder that never attached has recorded nothing.
                if signals.pending() {
                    self.ended = Duration::ZERO;
                }
            }
            Err(error) => tracing::error!(%error, "nothing is recorded"),
        }
    }

    fn catch_up(&mut self, signals: &Signals) {
        let asked = match &mut self.pipes {
            Some((ask, _)) => ask.write_all(b"?"),
            None => return,
        };
        let answered = asked.and_then(|()| self.hear(self.caught_up, signals));
        if !matches!(answered, Ok(true)) && !signals.pending() {
            tracing::warn!("the recorder does not answer; its file counts what it misses");
            self.pipes = None;
        }
    }
}

/// The recorder writes the rest at the end of the run.
impl Drop for RunRecorder<'_> {
    fn drop(&mut self) {
        if let Some(process) = &mut self.process {
            process.end(self.ended);
        }
    }
}
