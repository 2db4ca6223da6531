//! `firsthand topic`: the samples that a robot's processes publish.

mod echo;
mod hz;
mod python;
mod sample_text;

use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::table;
use crate::console::{failure::Failure, output::print_text};

/// List the topics, print their samples as they come, count their rates. Without a subcommand: `firsthand topic list`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    list: List,
}

#[derive(Debug, Subcommand)]
enum Command {
    List(List),
    Echo(echo::Arguments),
    Hz(hz::Arguments),
}

/// Print the table of topics.
#[derive(Debug, Args)]
struct List {
    /// Print a module for consumers in Python instead: the structs of all topics, and a class that follows a robot.
    #[arg(long)]
    python: bool,
}

pub(crate) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    match &arguments.command {
        None => arguments.list.print()?,
        Some(Command::List(list)) => list.print()?,
        Some(Command::Echo(arguments)) => echo::main(arguments)?,
        Some(Command::Hz(arguments)) => hz::main(arguments)?,
    }
    Ok(ExitCode::SUCCESS)
}

impl List {
    fn print(&self) -> Result<(), Failure> {
        print_text(&if self.python { python::module() } else { table::topics() })?;
        Ok(())
    }
}
