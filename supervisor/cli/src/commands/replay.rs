use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use common::clock::MissionTime;
use console::{failure::Result, operator, output::print};
use recording::{
    Recording,
    replay::{self, Options},
};

/// Replay a recording: give each generation of each stage its recorded inputs, and compare its outputs with the recorded ones to
/// the bit. Exits with 1 if something differs.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The directory of a run that was recorded, or a recording.
    #[arg(value_name = "RUN|F.mcap")]
    recording: PathBuf,
    /// Only these stages, with commas between.
    #[arg(long, value_name = "STAGES", value_delimiter = ',')]
    stage: Vec<String>,
    /// Compare from this mission time on, seconds.
    #[arg(long, value_name = "S", default_value = "0")]
    from: f64,
    /// Print one line of JSON at the end, and nothing else on standard output.
    #[arg(long)]
    json: bool,
}

pub fn main(arguments: &Arguments) -> Result<ExitCode> {
    for name in &arguments.stage {
        operator::known_stage(name)?;
    }
    let recording = Recording::open(&arguments.recording)?;
    let options = Options {
        stages: arguments.stage.clone(),
        from: MissionTime::from_seconds(arguments.from),
        run: None,
    };
    let report = replay::replay(&recording, &options)?;
    print(&report, arguments.json)?;
    Ok(ExitCode::from(u8::from(report.difference.is_some())))
}
