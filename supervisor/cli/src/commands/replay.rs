//! `firsthand replay F.mcap`: every generation of a recording again, compared to the bit; `firsthand diff A.mcap B.mcap`.

use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use common::clock::{MissionTime, Pace};
use recording::Recording;
use replay::Options;
use supervisor::stages;

use super::{Failure, print_text};

/// Replay a recording: feed each stage's generations what they took, and compare what comes out with what was recorded, to the
/// bit. Exits with 1 where something differs.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// The recording.
    #[arg(value_name = "F.mcap")]
    recording: PathBuf,
    /// Only these stages, with commas between.
    #[arg(long, value_name = "STAGES", value_delimiter = ',')]
    stage: Vec<String>,
    /// `max`, or R times mission time.
    #[arg(long, default_value = "max")]
    pace: Pace,
    /// Compare from this mission time on, seconds.
    #[arg(long, value_name = "S", default_value = "0")]
    from: f64,
    /// End with one line of JSON on standard output, and nothing else there.
    #[arg(long)]
    json: bool,
}

/// Find where two recordings part: the first tick, topic and field. Exits with 1 where they do.
#[derive(Debug, Args)]
pub(crate) struct Diff {
    /// The first recording.
    #[arg(value_name = "A.mcap")]
    first: PathBuf,
    /// The second.
    #[arg(value_name = "B.mcap")]
    second: PathBuf,
    /// Print one line of JSON.
    #[arg(long)]
    json: bool,
}

/// The exit code of a difference.
const DIFFERENT: u8 = 1;

pub(crate) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    for name in &arguments.stage {
        stages::find(name).ok_or_else(|| stages::unknown(name))?;
    }
    let recording = Recording::open(&arguments.recording)?;
    let options = Options {
        stages: arguments.stage.clone(),
        from: MissionTime::from_seconds(arguments.from),
        pace: arguments.pace,
        run: None,
    };
    let report = replay::replay(&recording, &options)?;
    print_text(&if arguments.json {
        format!("{}\n", serde_json::to_string(&report)?)
    } else {
        report.to_string()
    })?;
    Ok(code(report.difference.is_some()))
}

pub(crate) fn diff(arguments: &Diff) -> Result<ExitCode, Failure> {
    let open = |path: &PathBuf| Recording::open(path);
    let (first, second) = (open(&arguments.first)?, open(&arguments.second)?);
    let parting = replay::diff::diff(&first, &second)?;
    print_text(&if arguments.json {
        format!("{}\n", serde_json::to_string(&parting)?)
    } else {
        parting.to_string()
    })?;
    Ok(code(parting.first.is_some()))
}

fn code(different: bool) -> ExitCode {
    ExitCode::from(if different { DIFFERENT } else { 0 })
}
