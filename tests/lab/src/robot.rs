//! The executable `firsthand`, which the laboratory starts, and the processes of this machine.

use std::{
    ffi::OsStr,
    fmt::Display,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use console::failure::Refused;
use processes::{executable, process};

/// The path of `firsthand`, beside this executable or on `PATH`.
///
/// # Errors
/// It is at neither place.
pub fn path() -> Result<PathBuf, Refused> {
    executable::find(Path::new("firsthand")).map_err(|problem| {
        let build = "build it with `cargo build --release`";
        Refused::new("not-built", format!("firsthand: {problem}; {build}"))
    })
}

/// A subcommand of `firsthand` in a process of its own. It does not start if there is no `firsthand`, see [`path`].
pub fn firsthand(arguments: &[&str]) -> Command {
    let mut command = process::child(path().unwrap_or_default());
    // The robots of ROS 2 stay on this machine.
    command.args(arguments).env("ROS_LOCALHOST_ONLY", "1");
    command
}

/// `firsthand run` or `firsthand calibrate` of `robot` in `mission`, with assignments, which prints its result as JSON.
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

pub fn processes() -> impl Iterator<Item = u32> {
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok())
}

/// The other processes and their command lines, a space after each word.
pub fn command_lines() -> impl Iterator<Item = (u32, String)> {
    let others = processes().filter(|process| *process != std::process::id());
    others.map(|process| {
        // It is empty if the process has ended.
        let line = fs::read(format!("/proc/{process}/cmdline")).unwrap_or_default();
        (process, String::from_utf8_lossy(&line).replace('\0', " "))
    })
}
