use std::path::PathBuf;

use clap::Args;
use common::mission::Mission;

use console::{
    failure::Failure,
    missions,
    output::{print_text, write_stderr},
};

/// Check a mission file. An error is reported with its line, its key and the remedy.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// A mission file.
    file: PathBuf,
}

pub(crate) fn main(arguments: &Arguments) -> Result<(), Failure> {
    let mission = missions::complete(Mission::load(&arguments.file)?)?;
    super::run::refuse_unspoken(&mission)?;
    for remark in &mission.remarks {
        write_stderr(&format!("firsthand: {remark}\n"));
    }
    let frame = mission.grid_frame();
    Ok(print_text(&format!(
        "{}: {} m to the target, {} x {} cells of {:.3} m\n",
        mission.name,
        mission.target.length(),
        frame.cells,
        frame.cells,
        frame.resolution_m
    ))?)
}
