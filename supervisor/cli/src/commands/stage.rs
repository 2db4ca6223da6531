//! `firsthand stage NAME`: the process of one stage, started by the supervisor, by systemd or by a person.

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
    /// Name of the robot, where the supervisor only watches.
    #[arg(long, default_value = "x80", conflicts_with = "supervisor")]
    robot: RobotName,
    /// The parent process: this one stops when it ends.
    #[arg(long, hide = true, requires = "run")]
    supervisor: Option<u32>,
    /// The run directory.
    #[arg(long, hide = true, requires = "supervisor")]
    run: Option<PathBuf>,
    /// The generation of the stage.
    #[arg(long, hide = true, requires = "supervisor", default_value_t = 1)]
    generation: u32,
    /// Ticks before this one are an earlier generation's.
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
    match (stage.run)(&start) {
        Ok(()) => Ok(ExitCode::SUCCESS),
        Err(StageError::Bus(error)) => {
            eprintln!("firsthand: {error}");
            Ok(ExitCode::from(stages::REFUSED))
        }
        Err(error) => Err(error.into()),
    }
}
