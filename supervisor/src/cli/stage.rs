//! `firsthand stage NAME`: the process of one stage. The supervisor starts these.

use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use common::shell::Life;

use super::Failure;
use crate::stages;

/// Be one stage of a run (the supervisor starts these).
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Its name in the table (`firsthand stages`).
    name: String,
    /// The run directory.
    #[arg(long)]
    run: PathBuf,
    /// Which life of the stage this is.
    #[arg(long, default_value_t = 1)]
    generation: u32,
    /// Ticks before this one are another life's.
    #[arg(long, default_value_t = 0)]
    first_tick: u64,
    /// The process that must live for this one to live.
    #[arg(long)]
    supervisor: u32,
}

pub(super) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let stage = stages::find(&arguments.name).ok_or_else(|| stages::unknown(&arguments.name))?;
    let life = Life {
        stage: stage.name,
        directory: arguments.run.clone(),
        generation: arguments.generation,
        first_tick: arguments.first_tick,
        supervisor: arguments.supervisor,
    };
    (stage.live)(&life)?;
    Ok(ExitCode::SUCCESS)
}
