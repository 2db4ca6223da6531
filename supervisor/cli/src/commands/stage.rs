mod fault;
mod process;

pub use self::process::OTHER_PLANNERS;

use std::ffi::OsString;

use clap::{Args, Subcommand};
use common::domain::RobotName;
use rustix::process::Signal;

use super::table;
use console::{failure::Result, operator, output::print_text};

/// List, kill, freeze, restart and break the stages of a robot.
///
/// `firsthand stage NAME [--robot R]` runs the stage NAME. The supervisor starts this command; with
/// `run --watch-only`, systemd or you do. Without a subcommand: `firsthand stage list`.
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Print the table of stages.
    List,
    /// Send a signal to the process of a stage, by default SIGKILL.
    Kill {
        #[command(flatten)]
        process: StageProcess,
        /// Signal: KILL, TERM, INT, ABRT, STOP or CONT.
        #[arg(long, default_value = "KILL", value_parser = signal)]
        signal: Signal,
    },
    /// Freeze the process of a stage with SIGSTOP.
    Freeze(StageProcess),
    /// Continue the frozen process of a stage.
    Thaw(StageProcess),
    /// Replace the process of a stage by a new one.
    ///
    /// Releases a stage that is held because it died too often.
    Restart {
        /// Stage (`firsthand stage list`).
        stage: String,
        /// Name of the robot.
        #[arg(long, default_value_t)]
        robot: RobotName,
    },
    Fault(fault::Arguments),
    #[command(external_subcommand)]
    Process(Vec<OsString>),
}

/// Process of a robot.
#[derive(Debug, Args)]
struct StageProcess {
    /// Stage (`firsthand stage list`), or `supervisor`.
    stage: String,
    /// Name of the robot.
    #[arg(long, default_value_t)]
    robot: RobotName,
}

impl Arguments {
    pub const fn is_process(&self) -> bool {
        matches!(self.command, Some(Command::Process(_)))
    }
}

pub fn main(arguments: &Arguments) -> Result {
    match arguments.command.as_ref().unwrap_or(&Command::List) {
        Command::List => print_text(table::stages()),
        Command::Kill { process, signal } => process.send(*signal),
        Command::Freeze(process) => process.send(Signal::STOP),
        Command::Thaw(process) => process.send(Signal::CONT),
        Command::Restart { stage, robot } => {
            Ok(mission_control::operator::restart(robot, operator::known(stage)?)?)
        }
        Command::Fault(arguments) => fault::main(arguments),
        Command::Process(words) => process::run(words),
    }
}

impl StageProcess {
    fn send(&self, signal: Signal) -> Result {
        operator::send(&self.robot, &self.stage, signal)
    }
}

fn subcommands() -> Vec<String> {
    Command::augment_subcommands(clap::Command::new("stage"))
        .get_subcommands()
        .map(|it| it.get_name().to_owned())
        .collect()
}

fn signal(name: &str) -> Result<Signal, String> {
    Ok(match name.strip_prefix("SIG").unwrap_or(name) {
        "KILL" => Signal::KILL,
        "TERM" => Signal::TERM,
        "INT" => Signal::INT,
        "ABRT" => Signal::ABORT,
        "STOP" => Signal::STOP,
        "CONT" => Signal::CONT,
        _ => return Err("give KILL, TERM, INT, ABRT, STOP or CONT".to_owned()),
    })
}
