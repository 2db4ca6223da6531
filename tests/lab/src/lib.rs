//! The laboratory: what measures robots. It is a consumer like any other, starts `firsthand` from beside itself, and contains the
//! planners to compare with.
//!
//! | module | holds |
//! |---|---|
//! | `evaluate` | missions on many worlds |
//! | `experiments` | the paper's experiments |
//! | `field` | the field of a map |
//! | `bench` | random faults, the time of a tick, simulated sources |
//! | `stage` | the planners to compare with, as stages |

mod bench;
mod evaluate;
mod experiments;
mod field;
mod mission_progress;
mod stage;

use std::{
    error::Error,
    process::{ExitCode, Termination as _},
};

use clap::{Parser, Subcommand};
use console::{executable, failure::Failure};
use evaluation::{directory::DirectoryError, experiments::experiment::ExperimentError};

/// Measure robots: missions on many worlds, the paper's experiments, random faults, ticks, fields.
#[derive(Debug, Parser)]
#[command(name = "firsthand-lab", bin_name = "firsthand", version)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Evaluate(evaluate::Arguments),
    Experiments(experiments::Arguments),
    Field(field::Arguments),
    Bench(bench::Arguments),
    #[command(hide = true)]
    Stage(stage::Arguments),
}

/// The main function of the executable.
pub fn main() -> ExitCode {
    executable::run("error", execute, error_code)
}

fn execute(arguments: &Arguments) -> Result<ExitCode, Failure> {
    Ok(match &arguments.command {
        Command::Evaluate(arguments) => evaluate::main(arguments)?.report(),
        Command::Experiments(arguments) => experiments::main(arguments)?.report(),
        Command::Field(arguments) => field::main(arguments)?.report(),
        Command::Bench(arguments) => bench::main(arguments)?,
        Command::Stage(arguments) => stage::main(arguments)?.report(),
    })
}

fn error_code(error: &(dyn Error + 'static)) -> Option<&'static str> {
    if let Some(ExperimentError::Unknown { .. }) = error.downcast_ref() {
        return Some("unknown-experiment");
    }
    match error.downcast_ref()? {
        DirectoryError::Taken { .. } => Some("results-there"),
        DirectoryError::Another { .. } => Some("other-results"),
        DirectoryError::System { .. } => None,
    }
}
