//! Subcommands that are separate executables. Like git, `firsthand page` starts `firsthand-page`.

use std::{
    env,
    ffi::{OsStr, OsString},
    os::unix::process::CommandExt as _,
    path::Path,
    process::{Command, ExitCode},
};

use clap::Arg;
use console::{
    completion::{INDEX, VARIABLE},
    failure::{Failure, Refused, Result},
};
use processes::executable;

pub struct Companion {
    pub name: &'static str,
    pub executable: &'static str,
    pub about: &'static str,
}

const fn row(name: &'static str, executable: &'static str, about: &'static str) -> Companion {
    Companion { name, executable, about }
}

/// Executable that measures robots and contains the planners for comparison. It has several
/// subcommands and needs the companion's name.
pub const LABORATORY: &str = "firsthand-lab";

/// Companions for the package, completions, help and the manual page.
pub static TABLE: [Companion; 9] = [
    row("top", "firsthand-top", "Show a robot on the terminal, and stop it or kill its stages"),
    row("page", "firsthand-page", "Show a robot in a browser, and drive it with the drive token"),
    row("ros2", "firsthand-ros2", "Show a robot in ROS 2, to RViz and to other nodes"),
    row("foxglove", "firsthand-foxglove", "Serve a robot to Foxglove or Lichtblick, live"),
    row("remote", "firsthand-remote", "Show a robot of another machine on this one, read-only"),
    row("evaluate", LABORATORY, "Run missions on many worlds, and count the successes"),
    row("experiments", LABORATORY, "Repeat the paper's experiments, and compare the results"),
    row("field", LABORATORY, "Solve the harmonic field of a map, without a robot"),
    row("bench", LABORATORY, "Measure tick latency; test with random signals and faults"),
];

pub fn find(named: &OsStr) -> Option<&'static Companion> {
    TABLE.iter().find(|companion| named == companion.name)
}

/// Starts the companion named by `words` (after `firsthand`), or its help. Returns an error on
/// failure.
pub fn execute(words: &[OsString]) -> Option<Result<ExitCode>> {
    let (first, rest) = words.split_first()?;
    let (companion, options) = match find(first) {
        Some(companion) => (companion, rest.to_vec()),
        None if first == "help" => {
            let (asked, rest) = rest.split_first()?;
            (find(asked)?, [rest, &["--help".into()]].concat())
        }
        None => return None,
    };
    let name = (companion.executable == LABORATORY).then(|| companion.name.into());
    Some(Err(become_executable(companion.executable, name.into_iter().chain(options))))
}

/// Forwards a completion request. `words` are the executable, `--`, and the line to complete.
pub fn answer_shell(words: &[OsString]) {
    let Some(companion) = words.get(3).and_then(|word| find(word)) else { return };
    if env::var_os(VARIABLE).is_none() || words.len() < 5 {
        return;
    }
    let hidden = usize::from(companion.executable != LABORATORY);
    let Ok(executable) = executable::find(Path::new(companion.executable)) else { return };
    let mut command = Command::new(executable);
    command.arg("--").arg(companion.executable).args(&words[3 + hidden..]);
    if let Some(index) = env::var(INDEX).ok().and_then(|index| index.parse::<usize>().ok()) {
        command.env(INDEX, index.saturating_sub(hidden).to_string());
    }
    // Without the companion the shell gets no completions.
    let _ = command.exec();
}

impl Companion {
    pub fn command(&self) -> clap::Command {
        let words = Arg::new("words")
            .num_args(0..)
            .allow_hyphen_values(true)
            .help(format!("Those of {}: firsthand {} --help", self.executable, self.name));
        clap::Command::new(self.name).about(self.about).disable_help_flag(true).arg(words)
    }
}

/// Executes `named` from beside this executable or from PATH. Returns on failure.
pub fn become_executable(named: &str, words: impl Iterator<Item = OsString>) -> Failure {
    match executable::find(Path::new(named)) {
        Ok(found) => {
            let error = Command::new(&found).args(words).exec();
            format!("cannot execute {}: {error}", found.display()).into()
        }
        Err(problem) => {
            let build = "build it with `cargo build --release --workspace`, or install its package";
            Refused::new("not-built", format!("{named}: {problem}; {build}")).into()
        }
    }
}
