//! Subcommands, source of the parser, the dispatch and the groups of `--help`.

mod bring_up;
mod calibrate;
mod check;
mod diff;
mod doctor;
mod doubts;
mod go_back;
mod goto;
pub mod help;
mod init;
mod install;
mod logs;
mod man;
mod map;
mod missions;
mod place;
mod record;
mod replay;
mod report;
mod resume;
mod run;
mod run_report;
mod runs;
mod sim;
mod stage;
mod status;
mod stop;
mod table;
mod topic;
mod try_log;
mod zone;

use std::{
    ffi::{OsStr, OsString},
    process::{ExitCode, Termination as _},
};

use clap::{CommandFactory as _, Parser, Subcommand};
use console::{completion, failure::Result};

use crate::companions;

/// Declares groups of subcommands: a name, and the module with its `Arguments` and `main`.
///
/// Parentheses hold further arguments of `main`. Companions follow `@`.
macro_rules! commands {
    ($($heading:literal {
        $($name:ident $module:ident $(($whole:ident))?,)*
        $(@ $companion:literal)*
    })*) => {
        #[derive(Debug, Subcommand)]
        pub enum Command {
            $($($name($module::Arguments),)*)*
        }

        const GROUPS: &[(&str, &[&str])] =
            &[$(($heading, &[$(stringify!($name),)* $($companion,)*])),*];

        impl Command {
            pub fn execute(&self) -> Result<ExitCode> {
                Ok(match self {
                    $($(Self::$name(arguments) => $module::main(arguments $(, $whole())?)?.report(),)*)*
                })
            }
        }
    };
}

commands! {
    "Operate a robot" {
        Run run,
        Status status,
        Goto goto,
        Return go_back,
        Place place,
        Zone zone,
        Stop stop,
        Resume resume,
        @"top" @"page"
    }
    "Look at it" {
        Topic topic,
        Logs logs,
        Doubts doubts,
        Runs runs,
        Table table,
        Map map,
        @"ros2" @"foxglove" @"remote"
    }
    "Record it" {
        Record record,
        Replay replay,
        Report report,
    }
    "Judge it" {
        Check check,
        Try try_log,
        @"evaluate" @"experiments" @"field"
    }
    "Break it" {
        Stage stage,
        @"bench"
    }
    "Set up" {
        Missions missions,
        Install install,
        Help help(command_line),
        Doctor doctor,
        Init init,
        BringUp bring_up,
        Calibrate calibrate,
        Completions completion,
        Man man(command_line),
        Sim sim,
    }
}

/// Drive a ground robot through unknown, cluttered places to a target.
///
/// The robot needs encoders and range sensors: a front sonar suffices. Other sonars, infrared
/// rangers, lasers and depth cameras are optional. Without a subcommand: `firsthand run
/// obstacle-course`.
#[derive(Debug, Parser)]
#[command(
    name = "firsthand",
    version,
    disable_help_subcommand = true,
    help_template = format!("{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{}{{options}}{{after-help}}", listed()),
    after_help = format!("{}\n{EXIT_CODES}", help::pages())
)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
}

const EXIT_CODES: &str = "Exit codes of run:
  0  target reached, or stopped by Ctrl-C or SIGTERM
  1  could not start, or something failed
  2  wrong usage
  3  target unreachable
  4  timeout
  5  collision (simulated robot)
  6  aborted by a fault
  9  in the wrong place: by the ground truth (simulated robot), or at rest
 10  could not be stopped: the robot still moves after every stop method
 11  reached, unsure: the pose may be farther off than the mission allows
 78  invalid mission file; do not retry

The message of an error that a script can handle ends with a code in brackets.";

pub fn command_line() -> clap::Command {
    Arguments::command().subcommands(companions::TABLE.iter().map(companions::Companion::command))
}

pub fn parse<T: AsRef<OsStr>>(words: &[T]) -> Result<Command, clap::Error> {
    let executable = OsString::from("firsthand");
    let words =
        std::iter::once(executable).chain(words.iter().map(|word| word.as_ref().to_owned()));
    Arguments::try_parse_from(words)?.command.map_or_else(|| parse(&["run"]), Ok)
}

impl Command {
    /// Returns `None` for a command that sets up its own log.
    pub fn log_level(&self) -> Option<&'static str> {
        match self {
            Self::Run(_) | Self::BringUp(_) | Self::Calibrate(_) => None,
            Self::Stage(arguments) if arguments.is_process() => Some("info"),
            Self::Sim(_) => Some("info"),
            _ => Some("error"),
        }
    }
}

fn listed() -> String {
    let all = Command::augment_subcommands(clap::Command::new(""))
        .subcommands(companions::TABLE.iter().map(companions::Companion::command));
    let mut text = String::new();
    for (heading, names) in GROUPS {
        text += &format!("{heading}:\n");
        for name in *names {
            let is_it = |it: &&clap::Command| it.get_name().replace('-', "") == name.to_lowercase();
            let Some(command) = all.get_subcommands().find(is_it) else { continue };
            let (name, about) = (command.get_name(), command.get_about());
            let about = about.map(ToString::to_string).unwrap_or_default();
            let about = about
                .split([';', ':'])
                .next()
                .unwrap_or_default()
                .split(". ")
                .next()
                .unwrap_or_default();
            text += &format!("  {name:<12} {about}\n");
        }
        text.push('\n');
    }
    text + "Options:\n"
}
