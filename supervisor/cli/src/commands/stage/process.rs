//! `firsthand stage NAME`: the process of one stage, started by the supervisor, by systemd or by a person.

use std::{ffi::OsString, os::unix::process::CommandExt as _, process::Command};

use common::{
    external,
    mission::Mission,
    stage_command::{self, SUBCOMMAND},
    start::Start,
};
use supervisor::stages::Stage;

use crate::console::{failure::Failure, operator};

/// Be the stage that `words` name: its name, and its options.
pub(super) fn run(words: &[OsString]) -> Result<(), Failure> {
    let (name, options) = words.split_first().ok_or("name a stage")?;
    let name = name.to_string_lossy();
    let stage = operator::known_stage(&name)?;
    let start = stage_command::start_with(stage.name, options.iter().cloned())?;
    if let Start::External { robot, .. } = &start {
        become_executable(stage, &external::mission(robot)?, options)?;
    }
    Ok((stage.run)(&start)?)
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
