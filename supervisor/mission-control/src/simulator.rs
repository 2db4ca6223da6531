//! Simulated robot as a child process, with the ground truth on its standard output.

use std::{
    fs::{self, File},
    io::{self, Read, Write as _},
    net::SocketAddr,
    os::fd::{AsFd, BorrowedFd},
    path::Path,
    process::{ChildStdout, Command, Stdio},
    time::{Duration, Instant},
};

use common::{
    clock::Pace,
    domain::RobotName,
    file::append,
    ground_truth::{GROUND_TRUTH, GroundTruthHeader, GroundTruthTick},
    mission::Mission,
    poll, run,
};
use processes::process::Process;
use rustix::io::ioctl_fionbio;
use thiserror::Error;

use crate::{long_record, surroundings::SimulatedRobot};

/// Start timeout; a start takes seconds with 30 busy processes per core.
const STARTUP: Duration = Duration::from_secs(30);
/// End timeout. The simulator comes to rest and informs its world's other robot each tick, seconds
/// on a busy machine.
const REST: Duration = Duration::from_secs(5);
/// Maximum length of a ground-truth line, bytes; real lines stay under 300.
const LONGEST_LINE: usize = 64 * 1024;

#[derive(Debug, Error)]
pub enum SimulatorError {
    #[error("cannot {action} the simulated robot: {source}")]
    System { action: String, source: io::Error },
    #[error("the simulated robot did not start: {0}")]
    Startup(String),
    #[error("the start of the simulated robot was cancelled")]
    GivenUp,
}

fn system(action: impl Into<String>) -> impl FnOnce(io::Error) -> SimulatorError {
    let action = action.into();
    move |source| SimulatorError::System { action, source }
}

pub struct Simulator {
    process: Process,
    truth: GroundTruth,
    address: SocketAddr,
}

struct GroundTruth {
    pipe: ChildStdout,
    /// Copy of the tick lines for simulated sources of fixes; `None` once it cannot be written.
    file: Option<File>,
    unfinished: Vec<u8>,
    listening: Option<SocketAddr>,
    ticks: Vec<GroundTruthTick>,
}

impl Simulator {
    /// Returns once the simulator listens, or `given_up` is readable. It runs the executable
    /// `firsthand`, and continues from an earlier one's checkpoint in `directory`.
    pub fn start(
        mut firsthand: Command,
        robot: Option<&RobotName>,
        directory: &Path,
        mission: &Mission,
        pace: Pace,
        given_up: Option<BorrowedFd<'_>>,
    ) -> Result<Self, SimulatorError> {
        let text = toml::to_string(mission)
            .map_err(|error| system("write the mission of")(io::Error::other(error)))?;
        let file = directory.join("mission.toml");
        fs::write(&file, text).map_err(system(format!("write {} for", file.display())))?;
        let log_path = directory.join("x80-sim.log");
        let log = append(&log_path).map_err(system(format!("write {} for", log_path.display())))?;
        let checkpoint = run::checkpoint_file(directory, "x80-sim");
        let mission = file.to_str().ok_or_else(|| {
            SimulatorError::Startup("the run directory's name is not UTF-8".into())
        })?;
        firsthand.args([
            "sim",
            mission,
            "--pace",
            &pace.to_string(),
            "--ground-truth",
            "--supervisor",
            &std::process::id().to_string(),
        ]);
        firsthand.args(robot.iter().flat_map(|robot| ["--robot".to_owned(), robot.to_string()]));
        firsthand.arg("--keep").arg(checkpoint);
        firsthand.stdout(Stdio::piped()).stderr(log);
        let mut process = Process::spawn(firsthand).map_err(system("start"))?;
        let pipe = process
            .take_stdout()
            .ok_or_else(|| SimulatorError::Startup("it has no output".into()))?;
        ioctl_fionbio(&pipe, true).map_err(|errno| system("listen to")(errno.into()))?;
        let mut truth = GroundTruth {
            pipe,
            file: append(directory.join(GROUND_TRUTH)).ok(),
            unfinished: Vec::new(),
            listening: None,
            ticks: Vec::new(),
        };
        let began = Instant::now();
        loop {
            truth.take()?;
            if let Some(address) = truth.listening {
                return Ok(Self { process, truth, address });
            }
            if process.try_reap().map_err(system("watch"))?.is_some() || began.elapsed() > STARTUP {
                let words = fs::read_to_string(&log_path).unwrap_or_default();
                return Err(SimulatorError::Startup(words.trim().to_owned()));
            }
            let mut descriptors = vec![truth.pipe.as_fd(), process.as_fd()];
            descriptors.extend(given_up);
            let readable =
                poll::readable(&descriptors, Some(STARTUP)).map_err(system("wait for"))?;
            if readable.get(2) == Some(&true) {
                return Err(SimulatorError::GivenUp);
            }
        }
    }

    pub const fn address(&self) -> SocketAddr {
        self.address
    }
}

impl SimulatedRobot for Simulator {
    fn truth(&self) -> &[GroundTruthTick] {
        &self.truth.ticks
    }

    fn poll(&mut self) -> Result<bool, SimulatorError> {
        self.truth.take()?;
        Ok(self.process.try_reap().map_err(system("watch"))?.is_none())
    }

    fn stop(&mut self) -> Result<(), SimulatorError> {
        self.process.end(REST);
        self.truth.take()
    }

    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        Some(self.process.as_fd())
    }
}

impl GroundTruth {
    fn take(&mut self) -> Result<(), SimulatorError> {
        let mut bytes = [0; 16 * 1024];
        loop {
            match self.pipe.read(&mut bytes) {
                Ok(0) => return Ok(()),
                Ok(length) => self.unfinished.extend_from_slice(&bytes[..length]),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(()),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(system("listen to")(error)),
            }
            self.take_lines()?;
        }
    }

    fn take_lines(&mut self) -> Result<(), SimulatorError> {
        let Some(end) = self.unfinished.iter().rposition(|&byte| byte == b'\n') else {
            if self.unfinished.len() > LONGEST_LINE {
                return Err(SimulatorError::Startup("it writes a line that is too long".into()));
            }
            return Ok(());
        };
        let rest = self.unfinished.split_off(end + 1);
        let mut written = 0;
        for line in self.unfinished.split_inclusive(|&byte| byte == b'\n') {
            if self.listening.is_none() {
                let header = serde_json::from_slice::<GroundTruthHeader>(line).ok();
                self.listening = header.and_then(|header| header.listening.parse().ok());
                // The first tick may come together with the header.
                written += line.len();
            } else if let Ok(tick) = serde_json::from_slice(line) {
                long_record::push(&mut self.ticks, tick, long_record::merged);
            }
        }
        let ticks = &self.unfinished[written..];
        self.file.take_if(|file| file.write_all(ticks).is_err());
        self.unfinished = rest;
        debug_assert!(!self.unfinished.contains(&b'\n'));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_has_every_tick_though_the_first_comes_together_with_the_header() {
        let mut child = Command::new("true").stdout(Stdio::piped()).spawn().unwrap();
        let pipe = child.stdout.take().unwrap();
        child.wait().unwrap();
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join(GROUND_TRUTH);
        let header = GroundTruthHeader { listening: "127.0.0.1:1".to_owned(), laser: None };
        let line = |value: String| value + "\n";
        let tick = |tick| {
            let tick = GroundTruthTick { tick, ..GroundTruthTick::default() };
            line(serde_json::to_string(&tick).unwrap())
        };
        let mut truth = GroundTruth {
            pipe,
            file: Some(append(&path).unwrap()),
            unfinished: (line(serde_json::to_string(&header).unwrap()) + &tick(0)).into_bytes(),
            listening: None,
            ticks: Vec::new(),
        };
        truth.take_lines().unwrap();
        truth.unfinished = tick(1).into_bytes();
        truth.take_lines().unwrap();
        assert_eq!(truth.ticks.len(), 2);
        assert_eq!(fs::read_to_string(path).unwrap(), tick(0) + &tick(1));
    }
}
