//! The one executable: the command line of a robot's supervisor, its stages, the simulated robot and the tools.
//!
//! | module | holds |
//! |---|---|
//! | [`commands`] | one file a subcommand |
//! | [`summary`] | how a run ended, as numbers |
//! | [`summary_file`] | its file, with room reserved at the start |
//! | [`run_picture`] | the picture of a run |
//! | [`progress_line`] | progress on standard error |
//! | [`logging`] | logs to standard error, to a file, to the journal |

mod commands;
mod logging;
mod progress_line;
#[cfg(feature = "tools")]
mod run_picture;
mod summary;
mod summary_file;

use std::process::ExitCode;

use clap::{CommandFactory as _, Parser, Subcommand};

#[cfg(feature = "simulator")]
use commands::sim;
#[cfg(feature = "tools")]
use commands::{
    chaos, command_line, consumer, evaluate, experiments, field, latency, replay, report, top,
};
use commands::{
    check, echo, error_code, fault, help, hz, install, list, logs, missions, operate, other_user,
    record, run, runs, stage, status, tables,
};

/// Time-critical mobility for ground robots: a target, a perimeter, one sonar.
///
/// Without a subcommand: `firsthand run obstacle-course`.
#[derive(Debug, Parser)]
#[command(
    name = "firsthand",
    version,
    disable_help_subcommand = true,
    after_help = format!("{}\n{EXIT_CODES}", help::topics())
)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
enum Command {
    Run(run::Arguments),
    Stage(stage::Arguments),
    #[cfg(feature = "simulator")]
    Sim(sim::Arguments),
    Missions(missions::Arguments),
    Check(check::Arguments),
    #[cfg(feature = "tools")]
    Field(field::Arguments),
    #[cfg(feature = "tools")]
    Latency(latency::Arguments),
    #[cfg(feature = "tools")]
    Evaluate(evaluate::Arguments),
    #[cfg(feature = "tools")]
    Experiments(experiments::Arguments),
    Record(record::Arguments),
    #[cfg(feature = "tools")]
    Replay(replay::Arguments),
    #[cfg(feature = "tools")]
    Diff(replay::Diff),
    #[cfg(feature = "tools")]
    Report(report::Arguments),
    Status(status::Arguments),
    #[cfg(feature = "tools")]
    Top(top::Arguments),
    Echo(echo::Arguments),
    Hz(hz::Arguments),
    Logs(logs::Arguments),
    List(list::Arguments),
    Runs(runs::Arguments),
    Stop(operate::Stop),
    Resume(operate::Resume),
    Restart(operate::Restart),
    Kill(operate::Kill),
    Freeze(operate::Freeze),
    Thaw(operate::Thaw),
    Fault(fault::Arguments),
    #[cfg(feature = "tools")]
    Chaos(chaos::Arguments),
    #[cfg(feature = "tools")]
    Consumer(consumer::Arguments),
    Install(install::Arguments),
    Topics(tables::TopicArguments),
    Stages(tables::StageArguments),
    Failsafe(tables::FailsafeArguments),
    Faults(tables::FaultArguments),
    #[cfg(feature = "tools")]
    Completions(command_line::Completions),
    #[cfg(feature = "tools")]
    Man(command_line::Manual),
    Help(help::Arguments),
}

/// What `run` ends with.
const EXIT_CODES: &str = "Exit codes of run:
  0  target reached, or stopped by Ctrl-C or SIGTERM
  1  could not start, or something failed
  2  wrong usage
  3  target unreachable
  4  timeout
  5  collision (simulated robot)
  6  aborted by a fault
  7  an earlier run was cut off (--resume-last)
  9  in the wrong place by the ground truth (simulated robot)
 78  the mission is wrongly written: to try again is of no use

A message ends with the code of its error in brackets, where there is one: a script matches that.";

/// Run the command line of this process.
fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let command = arguments
        .command
        .unwrap_or_else(|| Command::Run(run::Arguments::default()));
    match &command {
        // It logs into its run directory.
        Command::Run(_) => {}
        Command::Stage(_) => logging::to_stderr("info"),
        #[cfg(feature = "simulator")]
        Command::Sim(_) => logging::to_stderr("info"),
        _ => logging::to_stderr("error"),
    }
    let result = match command {
        Command::Run(arguments) => run::main(&arguments),
        Command::Stage(arguments) => stage::main(&arguments),
        #[cfg(feature = "simulator")]
        Command::Sim(arguments) => sim::main(&arguments),
        Command::Missions(arguments) => missions::main(&arguments),
        Command::Check(arguments) => check::main(&arguments),
        #[cfg(feature = "tools")]
        Command::Field(arguments) => field::main(&arguments),
        #[cfg(feature = "tools")]
        Command::Latency(arguments) => latency::main(&arguments),
        #[cfg(feature = "tools")]
        Command::Evaluate(arguments) => evaluate::main(&arguments),
        #[cfg(feature = "tools")]
        Command::Experiments(arguments) => experiments::main(&arguments),
        Command::Record(arguments) => record::main(&arguments),
        #[cfg(feature = "tools")]
        Command::Replay(arguments) => replay::main(&arguments),
        #[cfg(feature = "tools")]
        Command::Diff(arguments) => replay::diff(&arguments),
        #[cfg(feature = "tools")]
        Command::Report(arguments) => report::main(&arguments),
        Command::Status(arguments) => status::main(&arguments),
        #[cfg(feature = "tools")]
        Command::Top(arguments) => top::main(&arguments),
        Command::Echo(arguments) => echo::main(&arguments),
        Command::Hz(arguments) => hz::main(&arguments),
        Command::Logs(arguments) => logs::main(&arguments),
        Command::List(arguments) => list::main(&arguments),
        Command::Runs(arguments) => runs::main(&arguments),
        Command::Stop(arguments) => operate::stop(&arguments),
        Command::Resume(arguments) => operate::resume(&arguments),
        Command::Restart(arguments) => operate::restart(&arguments),
        Command::Kill(arguments) => operate::kill(&arguments),
        Command::Freeze(arguments) => operate::freeze(&arguments),
        Command::Thaw(arguments) => operate::thaw(&arguments),
        Command::Fault(arguments) => fault::main(&arguments),
        #[cfg(feature = "tools")]
        Command::Chaos(arguments) => chaos::main(&arguments),
        #[cfg(feature = "tools")]
        Command::Consumer(arguments) => consumer::main(&arguments),
        Command::Install(arguments) => install::main(&arguments),
        Command::Topics(arguments) => tables::topics(&arguments),
        Command::Stages(arguments) => tables::stages(&arguments),
        Command::Failsafe(arguments) => tables::failsafe(&arguments),
        Command::Faults(arguments) => tables::faults(&arguments),
        #[cfg(feature = "tools")]
        Command::Completions(arguments) => {
            command_line::completions(&arguments, Arguments::command())
        }
        #[cfg(feature = "tools")]
        Command::Man(arguments) => command_line::manual(&arguments, Arguments::command()),
        Command::Help(arguments) => help::main(&arguments, Arguments::command()),
    };
    match result {
        Ok(code) => code,
        Err(error) => {
            let code = error_code::of(error.as_ref());
            let code = code.map_or(String::new(), |code| format!(" [{code}]"));
            progress_line::write_stderr(&format!("firsthand: {error}{code}\n"));
            if let Some(remark) = other_user::remark(error.as_ref()) {
                progress_line::write_stderr(&format!("firsthand: {remark}\n"));
            }
            error_code::exit_code(error.as_ref())
        }
    }
}
