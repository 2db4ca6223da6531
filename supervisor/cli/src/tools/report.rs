//! `firsthand report RUN|F.mcap`: one page and its figures from a recording.

use std::path::PathBuf;

use clap::Args;

use crate::console::{failure::Failure, output::print_text};

/// Write the report of a run from its recording: one page without references to other files, and each figure as SVG. `run` does
/// this at its end.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// The directory of a run that was recorded, or a recording.
    #[arg(value_name = "RUN|F.mcap")]
    run: PathBuf,
    /// The directory of the report; by default `report` in the run's directory, or `F-report` beside F.mcap.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub(crate) fn main(arguments: &Arguments) -> Result<(), Failure> {
    let page = report::write(&arguments.run, arguments.out.as_deref())?;
    Ok(print_text(&format!("{}\n", page.display()))?)
}
