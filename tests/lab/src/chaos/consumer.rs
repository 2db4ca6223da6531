//! A consumer that is hit beside the stages, and its command.

use std::{
    path::{Path, PathBuf},
    process::{Command, Stdio},
    str::FromStr,
};

use common::domain::RobotName;
use processes::{executable, process};

use crate::{error::Refused, robot};

/// The name of the recorder among the consumers.
pub const RECORD: &str = "record";

/// A program that reads from the bus: a subcommand of `firsthand`, or a user's command without a shell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Consumer {
    pub name: String,
    program: PathBuf,
    arguments: Vec<String>,
}

impl FromStr for Consumer {
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
        Ok(Self { name: command.to_owned(), program, arguments })
    }
}

impl Consumer {
    /// The subcommands of `firsthand` for `robot`.
    pub fn own(robot: &RobotName) -> Result<[Self; 3], Refused> {
        let program = robot::path()?;
        let own = |(name, words): (&str, &str)| Self {
            name: name.to_owned(),
            program: program.clone(),
            arguments: format!("{words} --robot {robot}").split(' ').map(str::to_owned).collect(),
        };
        Ok([(RECORD, "record"), ("hz", "topic hz"), ("logs -f", "logs --follow")].map(own))
    }

    /// The command that starts the consumer, which ends with this process.
    pub fn command(&self) -> Command {
        let own = std::process::id().to_string();
        let mut command = process::firsthand(&["bench", "consumer", &own]);
        command.arg(&self.program).args(&self.arguments).stdout(Stdio::null());
        command
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
            let error = command.parse::<Consumer>().unwrap_err();
            assert!(error.contains(problem) && error.contains("give a program"), "{error}");
        }
    }

    #[test]
    fn a_command_is_its_program_and_its_words_and_nothing_is_expanded() {
        let given: Consumer =
            "sh -c 'exit  1' \"d 'e\" f\\ g '' $HOME *.rs | `id`".parse().unwrap();
        assert!(given.program.is_absolute() && given.program.ends_with("sh"));
        let words = ["-c", "exit  1", "d 'e", "f g", "", "$HOME", "*.rs", "|", "`id`"];
        assert_eq!(given.arguments, words);
        let given: Consumer = "sh -c 'exit 1'".parse().unwrap();
        assert_eq!(given.name, "sh -c 'exit 1'");
    }
}
