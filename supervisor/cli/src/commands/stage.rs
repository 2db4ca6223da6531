//! `firsthand stage NAME`: the process of one stage. The supervisor starts these, or leaves it to systemd.

use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use common::{
    domain::RobotName,
    start::{Generation, StageError, Start},
};

use super::Failure;
use supervisor::stages;

/// Be one stage of a run. The supervisor starts these, unless it was given --watch-only: then you do, or systemd.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Its name in the table (`firsthand stages`).
    name: String,
    /// Whose, where the supervisor only watches; it says the rest.
    #[arg(long, default_value = "x80", conflicts_with = "supervisor")]
    robot: RobotName,
    /// The process that must live for this one to live, the parent.
    #[arg(long, hide = true, requires = "run")]
    supervisor: Option<u32>,
    /// The run directory.
    #[arg(long, hide = true, requires = "supervisor")]
    run: Option<PathBuf>,
    /// Which life of the stage this is.
    #[arg(long, hide = true, requires = "supervisor", default_value_t = 1)]
    generation: u32,
    /// Ticks before this one are another life's.
    #[arg(long, hide = true, requires = "supervisor", default_value_t = 0)]
    first_tick: u64,
}

pub(crate) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let stage = stages::find(&arguments.name).ok_or_else(|| stages::unknown(&arguments.name))?;
    let start = match (arguments.supervisor, &arguments.run) {
        (Some(supervisor), Some(directory)) => Start::Child {
            generation: Generation {
                stage: stage.name,
                directory: directory.clone(),
                number: arguments.generation,
                first_tick: arguments.first_tick,
            },
            supervisor,
        },
        _ => Start::External {
            stage: stage.name,
            robot: arguments.robot.clone(),
        },
    };
    match (stage.live)(&start) {
        Ok(()) => Ok(ExitCode::SUCCESS),
        Err(StageError::Bus(error)) => {
            eprintln!("firsthand: {error}");
            Ok(ExitCode::from(stages::REFUSED))
        }
        Err(error) => Err(error.into()),
    }
}
