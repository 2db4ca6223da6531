mod echo;
mod hz;
mod python;
mod sample_text;

use clap::{Args, Subcommand};

pub use self::echo::readable;

use super::table;
use console::{failure::Result, output::print_text};

/// List topics, print their samples, measure their rates.
///
/// Without a subcommand: `firsthand topic list`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Arguments {
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
    /// Print a Python module for consumers instead of the table.
    ///
    /// It has the structs of all topics, and a class that follows a robot.
    #[arg(long)]
    python: bool,
}

pub fn main(arguments: &Arguments) -> Result {
    match &arguments.command {
        None => list(&arguments.list),
        Some(Command::List(arguments)) => list(arguments),
        Some(Command::Echo(arguments)) => echo::main(arguments),
        Some(Command::Hz(arguments)) => hz::main(arguments),
    }
}

fn list(arguments: &List) -> Result {
    print_text(if arguments.python { python::module() } else { table::topics() })
}
