use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use common::clock::MissionTime;
use console::{failure::Result, operator, output::print};
use recording::{
    Recording,
    replay::{self, Options},
};

/// Replay a recording and compare the outputs of its stages bit by bit.
///
/// Each generation of each stage gets its recorded inputs. Exits with 1 if an output differs from
/// the recorded one.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Directory of a run with one recording, or a recording.
    #[arg(value_name = "RUN|F.mcap")]
    recording: PathBuf,
    /// Replay only these stages, separated by commas.
    #[arg(long, value_name = "STAGES", value_delimiter = ',')]
    stage: Vec<String>,
    /// Compare from this mission time on, seconds.
    #[arg(long, value_name = "S", default_value = "0")]
    from: f64,
    /// Print only one line of JSON on standard output, at the end.
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
