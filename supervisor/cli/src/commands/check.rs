//! `firsthand check FILE`.

use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use common::mission::Mission;

use super::Failure;

/// Say whether a mission file is one, and if not, line, key and remedy.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// A mission file.
    file: PathBuf,
}

#[allow(clippy::print_stdout, clippy::print_stderr)]
pub(crate) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let mission = Mission::load(&arguments.file)?;
    for remark in &mission.remarks {
        eprintln!("firsthand: {remark}");
    }
    let frame = mission.grid_frame();
    println!(
        "{}: {} m to the target, {} x {} cells of {:.3} m",
        mission.name,
        mission.target.length(),
        frame.cells,
        frame.cells,
        frame.resolution_m
    );
    Ok(ExitCode::SUCCESS)
}
