use std::path::PathBuf;

use clap::Args;

use console::{failure::Result, output::print_text};

/// Write the robot's page with the recording of a run in it, one file without references to others. `run` does this at its end.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The directory of a run that was recorded, or a recording.
    #[arg(value_name = "RUN|F.mcap")]
    run: PathBuf,
    /// The directory of the report; by default `report` in the run's directory, or `F-report` beside F.mcap.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub fn main(arguments: &Arguments) -> Result {
    let page = report::write(&arguments.run, arguments.out.as_deref())?;
    Ok(print_text(&format!("{}\n", page.display()))?)
}
