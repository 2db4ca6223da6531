//! Executable `firsthand`, its runs, simulated robots, and this machine's processes.

use std::{
    ffi::OsStr,
    fmt::Display,
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::Duration,
};

use common::{clock::Pace, file::append, mission::Mission, poll};
use console::robots::entries;
use mission_control::{recovery::SUMMARY, simulator::Simulator};
use processes::{
    death::log_tail,
    executable,
    process::{self, Process},
};
use summary::Summary;

use crate::error::{OrCannot as _, Result, refuse};

/// Returns the path of `firsthand`, beside this executable or on `PATH`.
pub fn path() -> Result<PathBuf> {
    executable::find(Path::new("firsthand")).or_else(|problem| {
        let build = "build it with `cargo build --release`";
        refuse("not-built", format!("firsthand: {problem}; {build}"))
    })
}

/// Fails to start without [`path`].
pub fn firsthand(arguments: &[&str]) -> Command {
    let mut command = process::child(path().unwrap_or_default());
    // ROS 2 robots stay on this machine.
    command.args(arguments).env("ROS_LOCALHOST_ONLY", "1");
    command
}

pub fn mission(
    subcommand: &str,
    mission: impl AsRef<OsStr>,
    robot: impl Display,
    set: &[String],
) -> Command {
    let mut command = firsthand(&[subcommand, "--json", "--robot", &robot.to_string()]);
    command.arg(mission).args(set.iter().flat_map(|assignment| ["--set", assignment]));
    command
}

/// Starts a simulated robot that outlives its supervisor, in wall-clock time, with files in
/// `directory`.
pub fn simulated(directory: &Path, mission: &Mission) -> Result<Simulator> {
    fs::create_dir_all(directory).or_cannot_file("make", directory)?;
    let pace = Pace::Rate(1.0);
    Ok(Simulator::start(firsthand(&[]), None, directory, mission, pace, None)?)
}

/// Interval of looks at a run that is waited for.
const LOOK_EVERY: Duration = Duration::from_secs(1);

pub struct Run {
    pub process: Process,
    directory: PathBuf,
}

impl Run {
    pub fn start(mut command: Command, directory: &Path, records: bool) -> Result<Self> {
        let said = append(said(directory));
        command.args((!records).then_some("--no-record"));
        command.args(["--parent", &std::process::id().to_string()]);
        command.stdout(Stdio::null()).stderr(said.or_cannot("write the log of a mission")?);
        let process = Process::spawn(command).or_cannot("start a mission")?;
        Ok(Self { process, directory: directory.to_owned() })
    }

    pub fn wait(mut self, mut look: impl FnMut()) -> Result<Self> {
        while self.process.try_reap().or_cannot("reap")?.is_none() {
            look();
            poll::is_readable(&self.process, LOOK_EVERY)?;
        }
        Ok(self)
    }

    /// # Errors
    /// Without a summary, the last line of the run's standard error.
    pub fn summary(&self) -> Result<Summary> {
        let summary = fs::read(self.directory.join(SUMMARY)).ok();
        summary.and_then(|summary| serde_json::from_slice(&summary).ok()).ok_or_else(|| {
            let file = said(&self.directory);
            let said = log_tail(&file, 0);
            let said = said.lines().last().unwrap_or("a mission left no summary");
            format!("{said}; see {}", file.display()).into()
        })
    }
}

fn said(directory: &Path) -> PathBuf {
    directory.with_extension("stderr")
}

pub fn processes() -> impl Iterator<Item = u32> {
    entries("/proc".as_ref()).filter_map(|entry| entry.file_name().to_str()?.parse().ok())
}

/// Returns other processes and their command lines, a space after each word.
pub fn command_lines() -> impl Iterator<Item = (u32, String)> {
    let others = processes().filter(|process| *process != std::process::id());
    others.map(|process| {
        let line = fs::read(format!("/proc/{process}/cmdline")).unwrap_or_default();
        (process, String::from_utf8_lossy(&line).replace('\0', " "))
    })
}
