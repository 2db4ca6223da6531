//! Command line of `firsthand`: supervisor, stages, recordings, and the simulated robot.
//!
//! | module | holds |
//! |---|---|
//! | [`commands`] | the list of subcommands |
//! | [`companions`] | subcommands that are separate executables: viewers, laboratory |

// `pub` marks use by another module; unused items are still reported.
#![allow(unreachable_pub)]

mod commands;
mod companions;

use std::process::ExitCode;

use console::{completion, failure, logging};

fn main() -> ExitCode {
    let words: Vec<_> = std::env::args_os().collect();
    companions::answer_shell(&words);
    completion::answer_shell(commands::command_line, commands::help::page_names);
    let executed = companions::execute(&words[1..]).unwrap_or_else(|| {
        let command = commands::parse(&words[1..]).unwrap_or_else(|error| error.exit());
        if let Some(level) = command.log_level() {
            logging::to_stderr(level);
        }
        command.execute()
    });
    failure::report(executed)
}
