//! `firsthand top`: the screen of a robot.

use std::{
    io::{self, IsTerminal as _},
    process::ExitCode,
};

use clap::Args;
use common::{domain::RobotName, samples::RequestKind};
use console::top::{self, Action};
use rustix::process::Signal;

use super::{Failure, error_code::Refused, operate, stream::let_stages_go_first};

/// Show a robot on the terminal: stages, believed map, field; keys kill, freeze, restart, stop, resume.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Name of the robot.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
}

pub(crate) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    if !(io::stdin().is_terminal() && io::stdout().is_terminal()) {
        let message =
            "top draws on a terminal; elsewhere there are `firsthand status` and `firsthand hz`";
        return Err(Refused::new("no-terminal", message).into());
    }
    let_stages_go_first();
    top::show(&arguments.robot, act)?;
    Ok(ExitCode::SUCCESS)
}

/// Do what a key asks for, as the subcommand of its name does.
fn act(robot: &RobotName, action: Action, stage: &str) -> Result<(), String> {
    let done = match action {
        Action::Kill => operate::send(robot, stage, Signal::KILL),
        Action::Freeze => operate::send(robot, stage, Signal::STOP),
        Action::Thaw => operate::send(robot, stage, Signal::CONT),
        Action::Restart => operate::ask(robot, RequestKind::Restart, stage),
        Action::Stop => operate::stand(robot),
        Action::Resume => operate::ask(robot, RequestKind::Resume, ""),
    };
    done.map(drop).map_err(|error| error.to_string())
}
