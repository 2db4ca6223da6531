//! `firsthand stage NAME`: the process of one stage, started by the supervisor, by systemd or by a person.

use std::{ffi::OsString, os::unix::process::CommandExt as _, path::Path, process::Command};

#[cfg(feature = "baselines")]
use common::shell::{StageError, run_stage};
use common::{
    external,
    mission::Mission,
    stage_command::{self, SUBCOMMAND},
    start::Start,
    stop_socket::Identity,
};
#[cfg(feature = "baselines")]
use evaluation::baselines::{bug::Bug, shell::Shell, wavefront::Wavefront};
#[cfg(feature = "baselines")]
use processes::stages::PLANNER;
use processes::{STOP_GUARD, guard, process::program_of, stages::Stage};

use crate::console::{failure::Failure, operator};

/// Be the stage that `words` name: its name, and its options.
pub(super) fn run(words: &[OsString]) -> Result<(), Failure> {
    let (name, options) = words.split_first().ok_or("name a stage")?;
    let name = name.to_string_lossy();
    if name == STOP_GUARD {
        let [directory, link] = options else {
            return Err("name the directory of a run and the socket of its link".into());
        };
        let link = Identity(link.to_string_lossy().into_owned());
        return Ok(guard(Path::new(directory), &link)?);
    }
    #[cfg(feature = "baselines")]
    if let Some(run) = baseline(&name) {
        let start = stage_command::start_with(PLANNER, options.iter().cloned())?;
        return Ok(run(&start)?);
    }
    let stage = operator::known_stage(&name)?;
    let start = stage_command::start_with(stage.name, options.iter().cloned())?;
    if let Start::External { robot, .. } = &start {
        become_executable(stage, &external::mission(robot)?, options)?;
    }
    Ok((stage.run)(&start)?)
}

/// The function that runs a stage's process until it is asked to stop.
#[cfg(feature = "baselines")]
type RunStage = fn(&Start) -> Result<(), StageError>;

/// The planners that take the place of `firsthand`'s own: two to compare with, and the one of `firsthand calibrate`.
#[cfg(feature = "baselines")]
pub(crate) const OTHER_PLANNERS: &[&str] = &["wavefront", "bug", calibration::PLANNER];
#[cfg(not(feature = "baselines"))]
pub(crate) const OTHER_PLANNERS: &[&str] = &[];

/// The process of the baseline `name`, which takes the place of the planner.
#[cfg(feature = "baselines")]
fn baseline(name: &str) -> Option<RunStage> {
    match name {
        "wavefront" => Some(run_stage::<Shell<Wavefront>>),
        "bug" => Some(run_stage::<Shell<Bug>>),
        calibration::PLANNER => Some(run_stage::<calibration::shell::Shell>),
        _ => None,
    }
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
    let (program, called) = program_of(Some(executable), stage.name);
    let mut command = Command::new(program);
    command.args([SUBCOMMAND, called]);
    let error = command.args(options).exec();
    Err(format!("cannot execute {}: {error}", executable.display()).into())
}
