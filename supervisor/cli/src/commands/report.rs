use std::path::PathBuf;

use clap::Args;

use console::{failure::Result, output::print_line};

/// Write a run as the robot's page, in one self-contained file.
///
/// `run` does this at its end.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Directory of a recorded run, or a recording.
    #[arg(value_name = "RUN|F.mcap")]
    run: PathBuf,
    /// Directory of the report.
    ///
    /// Default: `report` in the run's directory, or `F-report` beside F.mcap.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub fn main(arguments: &Arguments) -> Result {
    print_line(report::write(&arguments.run, arguments.out.as_deref())?.display())
}
