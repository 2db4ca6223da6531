//! `firsthand`, the robot: the command line of its supervisor, its stages, its recordings, and the simulated robot.
//!
//! | module | holds |
//! |---|---|
//! | [`commands`] | the one list of subcommands |
//! | [`companions`] | the subcommands that are executables beside this one: viewers, laboratory |

// No other crate uses these modules: `pub` says that another module does, and what none uses is reported all the same.
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
