//! Shell completions. The script asks the executable, which also completes robots, stages, topics,
//! missions and pages.

use std::ffi::OsStr;

use clap::{
    Arg, Args, Command,
    builder::{PossibleValuesParser, ValueParser},
};
use clap_complete::{
    ArgValueCompleter, CompleteEnv, CompletionCandidate, PathCompleter,
    engine::{SubcommandCandidates, ValueCompleter as _},
    env::Shells,
};
use common::{domain::RobotName, topics};
use processes::stages;

use crate::{failure::Result, missions, output::print_text, robots};

/// Print the completion script for a shell.
///
/// Example: `firsthand completions bash > ~/.local/share/bash-completion/completions/firsthand`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Shell that reads the script.
    #[arg(value_parser = PossibleValuesParser::new(Shells::builtins().names()))]
    shell: String,
}

/// Variable by which the script of a shell asks.
pub const VARIABLE: &str = "FIRSTHAND_COMPLETE";
/// Variable in which Bash and zsh give the index of the completed word.
pub const INDEX: &str = "_CLAP_COMPLETE_INDEX";
/// Name that the shell finds on PATH.
const EXECUTABLE: &str = "firsthand";

pub fn main(arguments: &Arguments) -> Result {
    let shells = Shells::builtins();
    let shell = shells.completer(&arguments.shell).ok_or("name a shell")?;
    let mut script = Vec::new();
    shell.write_registration(VARIABLE, EXECUTABLE, EXECUTABLE, EXECUTABLE, &mut script)?;
    print_text(String::from_utf8_lossy(&script))
}

/// Answers a shell's request and ends. `whole` is the command line, `pages` the guide.
pub fn answer_shell(whole: fn() -> Command, pages: fn() -> Vec<String>) {
    CompleteEnv::with_factory(|| with_candidates(whole(), pages)).var(VARIABLE).complete();
}

fn with_candidates(command: Command, pages: fn() -> Vec<String>) -> Command {
    command
        // Only `stage` uses these, because it accepts unknown words.
        .add(SubcommandCandidates::new(|| candidates("", stage_names())))
        .mut_args(|argument| match completer(&argument, pages) {
            Some(completer) => argument.add(completer),
            None => argument,
        })
        .mut_subcommands(|subcommand| with_candidates(subcommand, pages))
}

fn completer(argument: &Arg, pages: fn() -> Vec<String>) -> Option<ArgValueCompleter> {
    let robot = ValueParser::new(|name: &str| name.parse::<RobotName>()).type_id();
    if argument.get_value_parser().type_id() == robot {
        return Some(named(|| {
            let (running, killed) = robots::own();
            running.iter().chain(&killed).map(|robot| robot.name.to_string()).collect()
        }));
    }
    Some(match argument.get_id().as_str() {
        "stage" => named(stage_names),
        "topic" | "topics" => {
            named(|| topics::TABLE.iter().map(|topic| topic.spec().name.to_owned()).collect())
        }
        "mission" => ArgValueCompleter::new(|current: &OsStr| {
            let files = PathCompleter::file().complete(current);
            let shipped = missions::SHIPPED.map(|(name, _)| name.to_owned());
            let mut all = candidates(&current.to_string_lossy(), shipped.to_vec());
            all.extend(files);
            all
        }),
        "page" => named(pages),
        _ => return None,
    })
}

fn named(names: impl Fn() -> Vec<String> + Send + Sync + 'static) -> ArgValueCompleter {
    ArgValueCompleter::new(move |current: &OsStr| candidates(&current.to_string_lossy(), names()))
}

fn candidates(current: &str, names: Vec<String>) -> Vec<CompletionCandidate> {
    names
        .into_iter()
        .filter(|name| name.starts_with(current))
        .map(CompletionCandidate::new)
        .collect()
}

fn stage_names() -> Vec<String> {
    stages::TABLE.iter().map(|stage| stage.name.to_owned()).collect()
}
