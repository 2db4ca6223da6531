//! Command line of a stage's process, written by the supervisor and read by every stage executable.
//!
//! | form | started by |
//! |---|---|
//! | `stage NAME --run DIR --generation N --first-tick T --supervisor PID` | the supervisor |
//! | `stage NAME [--robot R]` | systemd or a person, for a supervisor that only watches |

use std::{ffi::OsString, path::PathBuf, str::FromStr};

use thiserror::Error;

use crate::{
    domain::RobotName,
    start::{Generation, Start},
};

pub const SUBCOMMAND: &str = "stage";

#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error(
    "{problem}; let `firsthand run` start the stage, or, with --watch-only, start it by `stage {stage} --robot NAME`"
)]
pub struct StageCommandError {
    stage: &'static str,
    problem: String,
}

/// Returns the arguments with which `supervisor` starts the process of `generation`. `called` names
/// its stage, or the baseline in its place.
pub fn arguments(called: &str, generation: &Generation, supervisor: u32) -> Vec<OsString> {
    let Generation { stage: _, directory, number, first_tick } = generation;
    vec![
        SUBCOMMAND.into(),
        called.into(),
        "--run".into(),
        directory.into(),
        "--generation".into(),
        number.to_string().into(),
        "--first-tick".into(),
        first_tick.to_string().into(),
        "--supervisor".into(),
        supervisor.to_string().into(),
    ]
}

pub fn start(
    stage: &'static str,
    arguments: impl IntoIterator<Item = OsString>,
) -> Result<Start, StageCommandError> {
    let mut arguments = arguments.into_iter();
    let named = [arguments.next(), arguments.next()];
    if named != [Some(SUBCOMMAND.into()), Some(stage.into())] {
        let named: Vec<_> = named.into_iter().flatten().collect();
        let problem = format!("this executable is the stage {stage}, but was given {named:?}");
        return Err(StageCommandError { stage, problem });
    }
    start_with(stage, arguments)
}

pub fn start_with(
    stage: &'static str,
    options: impl IntoIterator<Item = OsString>,
) -> Result<Start, StageCommandError> {
    let failed = |problem: String| StageCommandError { stage, problem };
    let mut run = None::<PathBuf>;
    let mut robot = None::<RobotName>;
    let mut number = None;
    let mut first_tick = None;
    let mut supervisor = None;
    let mut options = options.into_iter();
    while let Some(option) = options.next() {
        let value = options.next();
        let value = value.ok_or_else(|| failed(format!("{} has no value", option.display())))?;
        match option.to_str() {
            Some("--run") => run = Some(value.into()),
            Some(name @ "--generation") => number = Some(parsed(stage, name, &value)?),
            Some(name @ "--first-tick") => first_tick = Some(parsed(stage, name, &value)?),
            Some(name @ "--supervisor") => supervisor = Some(parsed(stage, name, &value)?),
            Some(name @ "--robot") => robot = Some(parsed(stage, name, &value)?),
            _ => return Err(failed(format!("{} is an unknown option", option.display()))),
        }
    }
    match (run, supervisor, robot) {
        (Some(directory), Some(supervisor), None) => Ok(Start::Child {
            generation: Generation {
                stage,
                directory,
                number: number.unwrap_or(1),
                first_tick: first_tick.unwrap_or(0),
            },
            supervisor,
        }),
        (None, None, robot) if number.is_none() && first_tick.is_none() => {
            Ok(Start::External { stage, robot: robot.unwrap_or_default() })
        }
        _ => Err(failed(
            "--run, --supervisor, --generation and --first-tick go together, without --robot"
                .to_owned(),
        )),
    }
}

fn parsed<T: FromStr>(
    stage: &'static str,
    option: &str,
    value: &OsString,
) -> Result<T, StageCommandError> {
    value.to_str().and_then(|value| value.parse().ok()).ok_or_else(|| StageCommandError {
        stage,
        problem: format!("{option} {} has an invalid value", value.display()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> Vec<OsString> {
        line.split_whitespace().map(OsString::from).collect()
    }

    #[test]
    fn a_stage_reads_what_the_supervisor_writes() {
        let written = Generation {
            stage: "planner",
            directory: "/runs/a b".into(),
            number: 3,
            first_tick: 77,
        };
        let read = start("planner", arguments("planner", &written, 4711)).unwrap();
        let Start::Child { generation, supervisor } = read else {
            panic!("{read:?}");
        };
        assert_eq!((generation, supervisor), (written, 4711));
    }

    #[test]
    fn a_stage_started_by_a_person_is_external() {
        for (line, name) in [("", "x80"), ("--robot r2", "r2")] {
            let read = start_with("planner", words(line)).unwrap();
            let Start::External { stage, robot } = read else {
                panic!("{read:?}");
            };
            assert_eq!((stage, robot.to_string().as_str()), ("planner", name));
        }
    }

    #[test]
    fn a_command_line_that_is_none_is_refused_with_what_is_wrong() {
        for (line, problem) in [
            ("", "was given []"),
            ("stage mapper --robot a", "mapper"),
            ("stage planner --run", "--run has no value"),
            ("stage planner --supervisor x", "--supervisor x"),
            ("stage planner --robot a/b", "--robot a/b"),
            ("stage planner --warp 9", "--warp is an unknown option"),
            ("stage planner --run /tmp", "go together"),
            ("stage planner --run /tmp --supervisor 1 --robot a", "go together"),
        ] {
            let said = start("planner", words(line)).unwrap_err().to_string();
            assert!(said.contains(problem), "{line:?}: {said}");
        }
    }
}
