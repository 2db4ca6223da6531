//! Process of one stage, started by the supervisor, by systemd or by a person.

use std::{ffi::OsString, os::unix::process::CommandExt as _, path::Path, process::Command};

use common::{
    external,
    mission::Mission,
    shell::run_stage,
    stage_command::{self, SUBCOMMAND},
    start::Start,
    stop_socket::Identity,
};
use processes::{
    STOP_GUARD, guard,
    process::program_of,
    stages::{PLANNER, Stage},
};

use crate::companions::{self, LABORATORY};

use console::{
    failure::{Refused, Result},
    operator,
};

/// Least similarity for a suggested name.
const NEAR: f64 = 0.8;

pub fn run(words: &[OsString]) -> Result {
    let (name, options) = words.split_first().ok_or("name a stage")?;
    let name = name.to_string_lossy();
    if name == STOP_GUARD {
        let [directory, link] = options else {
            return Err("name the directory of a run and the socket of its link".into());
        };
        let link = Identity(link.to_string_lossy().into_owned());
        return Ok(guard(Path::new(directory), &link)?);
    }
    if name == calibration::PLANNER {
        let start = stage_command::start_with(PLANNER, options.iter().cloned())?;
        return Ok(run_stage::<calibration::shell::Shell>(&start)?);
    }
    if OTHER_PLANNERS.contains(&&*name) {
        // The laboratory has the other planners.
        let words = std::iter::once(SUBCOMMAND.into()).chain(words.iter().cloned());
        return Err(companions::become_executable(LABORATORY, words));
    }
    let stage = operator::known_stage(&name).map_err(|unknown| {
        let known = super::subcommands();
        let near = known
            .iter()
            .find(|known| strsim::jaro_winkler(known, &name) > NEAR)
            .map_or(String::new(), |near| format!("; did you mean `stage {near}`?"));
        Refused::new(
            "unknown-stage",
            format!("{unknown}; `stage` has no such subcommand either{near}"),
        )
    })?;
    let start = stage_command::start_with(stage.name, options.iter().cloned())?;
    if let Start::External { robot, .. } = &start {
        become_executable(stage, &external::mission(robot)?, options)?;
    }
    Ok((stage.run)(&start)?)
}

/// Alternative planners: one for comparison, and that of `firsthand calibrate`.
pub const OTHER_PLANNERS: &[&str] = &["wavefront", calibration::PLANNER];

fn become_executable(stage: &Stage, mission: &Mission, options: &[OsString]) -> Result {
    let Some(executable) = stage.executable(mission) else {
        return Ok(());
    };
    let (program, called) = program_of(Some(executable), stage.name);
    let mut command = Command::new(program);
    command.args([SUBCOMMAND, called]);
    let error = command.args(options).exec();
    Err(format!("cannot execute {}: {error}", executable.display()).into())
}
