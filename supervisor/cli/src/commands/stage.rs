//! `firsthand stage NAME`: the process of one stage, started by the supervisor, by systemd or by a person.

use std::{
    ffi::OsString,
    os::unix::process::CommandExt as _,
    process::{Command, ExitCode},
};

use clap::Args;
use common::{
    external,
    mission::Mission,
    stage_command::{self, SUBCOMMAND},
    start::Start,
};

use super::{Failure, operate};
use crate::progress_line::write_stderr;
use supervisor::stages::Stage;

/// Be one stage of a run. The supervisor starts these, unless it was given --watch-only: then you do, or systemd.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Its name in the table (`firsthand stages`).
    name: String,
    /// Name of the robot, where the supervisor only watches: `--robot x80` if unsaid.
    #[arg(
        value_name = "--robot NAME",
        trailing_var_arg = true,
        allow_hyphen_values = true
    )]
    options: Vec<OsString>,
}

pub(crate) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let stage = operate::known_stage(&arguments.name)?;
    let start = stage_command::start_with(stage.name, arguments.options.iter().cloned())?;
    if let Start::External { robot, .. } = &start {
        become_executable(stage, &external::mission(robot)?, &arguments.options)?;
    }
    (stage.run)(&start).map_or_else(
        |error| {
            write_stderr(&format!("firsthand: {error}\n"));
            Ok(ExitCode::from(error.exit_code()))
        },
        |()| Ok(ExitCode::SUCCESS),
    )
}

/// Become the executable that `mission` names for `stage`, if it names one.
fn become_executable(
    stage: &Stage,
    mission: &Mission,
    options: &[OsString],
) -> Result<(), Failure> {
    let Some(executable) = stage.executable(mission) else {
        return Ok(());
    };
    let mut command = Command::new(executable);
    let error = command.args([SUBCOMMAND, stage.name]).args(options).exec();
    Err(format!("cannot execute {}: {error}", executable.display()).into())
}
