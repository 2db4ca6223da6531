//! The consumers that are hit beside the stages, and the command of each.

use std::{
    path::{Path, PathBuf},
    process::Command,
    str::FromStr,
};

use common::domain::RobotName;
use processes::{executable, process};

use crate::{chaos::terminal, robot};

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Consumer {
    /// The recorder that the run itself starts. It is not restarted within its run.
    RunRecorder,
    /// Another `firsthand record`.
    Record,
    /// `firsthand top`, on a terminal of its own.
    Top,
    /// `firsthand topic hz`.
    Hz,
    /// `firsthand logs -f`.
    Logs,
    Given(GivenConsumer),
}

/// A user's consumer: a command without a shell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenConsumer {
    command: String,
    program: PathBuf,
    arguments: Vec<String>,
}

impl FromStr for GivenConsumer {
    type Err = String;

    fn from_str(command: &str) -> Result<Self, String> {
        let found = || {
            // No program takes such a word.
            if command.contains('\0') {
                return Err("it contains a zero byte".to_owned());
            }
            let words =
                shlex::split(command).ok_or("it ends within quotes or after a backslash")?;
            let mut words = words.into_iter();
            let program = words.next().ok_or("there is nothing in it")?;
            let found = executable::find(Path::new(&program));
            let found = found.map_err(|problem| format!("{program}: {problem}"))?;
            Ok((found, words.collect()))
        };
        let (program, arguments) = found().map_err(|problem: String| {
            format!(
                "the consumer {command:?} cannot be started: {problem}; give a program, by its path or by a name on PATH, and its \
                 arguments, in quotes where they contain spaces (no shell reads them)"
            )
        })?;
        Ok(Self { command: command.to_owned(), program, arguments })
    }
}

impl Consumer {
    /// The consumers of `firsthand`. Without terminals `hz` replaces `top`.
    pub fn own() -> Vec<Self> {
        let shows = match terminal::open() {
            Ok(_) => Self::Top,
            Err(_) => Self::Hz,
        };
        vec![Self::RunRecorder, Self::Record, shows, Self::Logs]
    }

    pub fn name(&self) -> &str {
        match self {
            Self::RunRecorder => "run's recorder",
            Self::Record => "record",
            Self::Top => "top",
            Self::Hz => "hz",
            Self::Logs => "logs -f",
            Self::Given(given) => &given.command,
        }
    }

    /// The command that starts the consumer for `robot`; a recorder writes into `recording`. None for the run's own
    /// recorder.
    pub fn command(&self, robot: &RobotName, recording: &Path) -> Option<Command> {
        let own: &[&str] = match self {
            Self::RunRecorder => return None,
            Self::Record => &["record"],
            Self::Top => &["top"],
            Self::Hz => &["topic", "hz"],
            Self::Logs => &["logs", "--follow"],
            Self::Given(_) => &[],
        };
        // The subcommand executes the program, and ends with its parent.
        let mut command =
            process::firsthand(&["bench", "consumer", &std::process::id().to_string()]);
        if let Self::Given(given) = self {
            command.arg(&given.program).args(&given.arguments);
        } else {
            command.arg(robot::path().unwrap_or_default()).args(own);
            command.args(["--robot", &robot.to_string()]);
        }
        if *self == Self::Record {
            command.arg("--out").arg(recording);
        }
        Some(command)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_without_a_program_is_refused_with_what_is_wrong_and_the_remedy() {
        for (command, problem) in [
            ("no-such-logger x80", "no-such-logger: "),
            ("./no/such/logger", "./no/such/logger: "),
            ("/tmp x", "/tmp: "),
            ("sh 'x", "ends within quotes"),
            ("sh \"x\\", "ends within quotes"),
            ("sh \\", "ends within quotes"),
            (" \t", "nothing in it"),
            ("sh\0x", "zero byte"),
        ] {
            let error = command.parse::<GivenConsumer>().unwrap_err();
            assert!(error.contains(problem) && error.contains("give a program"), "{error}");
        }
    }

    #[test]
    fn a_command_is_its_program_and_its_words_and_nothing_is_expanded() {
        let given: GivenConsumer =
            "sh -c 'exit  1' \"d 'e\" f\\ g '' $HOME *.rs | `id`".parse().unwrap();
        assert!(given.program.is_absolute() && given.program.ends_with("sh"));
        let words = ["-c", "exit  1", "d 'e", "f g", "", "$HOME", "*.rs", "|", "`id`"];
        assert_eq!(given.arguments, words);
        let given: GivenConsumer = "sh -c 'exit 1'".parse().unwrap();
        assert_eq!(Consumer::Given(given).name(), "sh -c 'exit 1'");
    }
}
