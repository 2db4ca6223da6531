//! The one executable: the command line of a robot's supervisor, its stages, the simulated robot and the tools.
//!
//! | module | holds |
//! |---|---|
//! | [`commands`] | the one list of subcommands, and those that a robot needs |
//! | [`tools`] | the subcommands that a robot does without |
//! | [`console`] | what subcommands share: output, failures, robots, runs, words |
//! | [`renamed`] | the names that subcommands had before |
//! | [`logging`] | logs to standard error, to a file, to the journal |

mod commands;
mod console;
mod logging;
mod renamed;
#[cfg(feature = "tools")]
mod tools;

use std::process::ExitCode;

use console::{failure, output::write_stderr};

fn main() -> ExitCode {
    #[cfg(feature = "tools")]
    tools::completions::answer_shell(commands::command_line, commands::help::page_names);
    let words: Vec<_> = std::env::args_os().skip(1).collect();
    let command = commands::parse(&words).unwrap_or_else(|error| error.exit());
    if let Some(level) = command.log_level() {
        logging::to_stderr(level);
    }
    command.execute().unwrap_or_else(|error| {
        let code = failure::code(error.as_ref());
        #[cfg(feature = "tools")]
        let code = code.or_else(|| tools::error_code::of(error.as_ref()));
        let code = code.map_or(String::new(), |code| format!(" [{code}]"));
        write_stderr(&format!("firsthand: {error}{code}\n"));
        if let Some(remark) = failure::remark(error.as_ref()) {
            write_stderr(&format!("firsthand: {remark}\n"));
        }
        failure::exit_code(error.as_ref())
    })
}
