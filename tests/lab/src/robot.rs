//! The executable `firsthand`, which the laboratory starts, and the processes of this machine.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use console::failure::Refused;
use supervisor::{executable, process};

/// The path of `firsthand`, beside this executable or on `PATH`.
///
/// # Errors
/// It is at neither place.
pub(crate) fn path() -> Result<PathBuf, Refused> {
    executable::find(Path::new("firsthand")).map_err(|problem| {
        let build = "build it with `cargo build --release`";
        Refused::new("not-built", format!("firsthand: {problem}; {build}"))
    })
}

/// A subcommand of `firsthand` in a process of its own. It does not start if there is no `firsthand`, see [`path`].
pub(crate) fn firsthand(arguments: &[&str]) -> Command {
    let mut command = process::child(path().unwrap_or_default());
    command.args(arguments);
    command
}

/// The ids of all processes of this machine.
pub(crate) fn processes() -> impl Iterator<Item = u32> {
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok())
}

/// The command line of `process`, a zero byte after each word; empty if it has ended.
pub(crate) fn command_line(process: u32) -> Vec<u8> {
    fs::read(format!("/proc/{process}/cmdline")).unwrap_or_default()
}
