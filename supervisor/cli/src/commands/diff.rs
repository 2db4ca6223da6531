use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use recording::{Recording, replay::diff};

use console::{failure::Result, output::print};

/// Find the first tick, topic and field in which two recordings differ.
///
/// Exits with 1 if the recordings differ.
#[derive(Debug, Args)]
pub struct Arguments {
    /// First recording, or the directory of its run.
    #[arg(value_name = "A|A.mcap")]
    first: PathBuf,
    /// Second recording, or the directory of its run.
    #[arg(value_name = "B|B.mcap")]
    second: PathBuf,
    /// Print one line of JSON.
    #[arg(long)]
    json: bool,
}

pub fn main(arguments: &Arguments) -> Result<ExitCode> {
    let first = Recording::open(&arguments.first)?;
    let second = Recording::open(&arguments.second)?;
    let parting = diff::diff(&first, &second)?;
    print(&parting, arguments.json)?;
    Ok(ExitCode::from(u8::from(parting.first.is_some())))
}
