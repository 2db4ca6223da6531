//! Subcommands that are executables beside this one, started as git starts its own: `firsthand page` becomes
//! `firsthand-page`.

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
    executable: &'static str,
    /// The executable has further subcommands and is told this one's name.
    is_one_of_many: bool,
    pub about: &'static str,
}

const fn viewer(name: &'static str, executable: &'static str, about: &'static str) -> Companion {
    Companion { name, executable, is_one_of_many: false, about }
}

const fn laboratory(name: &'static str, about: &'static str) -> Companion {
    Companion { name, executable: LABORATORY, is_one_of_many: true, about }
}

/// It measures robots and contains the planners to compare with.
pub const LABORATORY: &str = "firsthand-lab";

/// THE table: the package, completions, help and the manual page know them from here.
pub static TABLE: [Companion; 9] = [
    viewer(
        "top",
        "firsthand-top",
        "Show a robot on the terminal, with keys to kill, freeze, restart, stop, resume",
    ),
    viewer(
        "page",
        "firsthand-page",
        "Show a robot in a browser, with orders for whoever has the token to drive",
    ),
    viewer("ros2", "firsthand-ros2", "Show a robot in ROS 2, to RViz and to other nodes"),
    viewer("foxglove", "firsthand-foxglove", "Serve a robot to Foxglove or Lichtblick, live"),
    viewer("remote", "firsthand-remote", "Show a robot of another machine on this one, read-only"),
    laboratory("evaluate", "Run missions on many worlds and count successes by the ground truth"),
    laboratory(
        "experiments",
        "Repeat the paper's experiments and compare the results with those of the paper",
    ),
    laboratory("field", "Solve the harmonic field of a map, without a robot"),
    laboratory("bench", "Measure ticks; send random signals to a robot's processes"),
];

pub fn find(named: &OsStr) -> Option<&'static Companion> {
    TABLE.iter().find(|companion| named == companion.name)
}

/// `words` after `firsthand` name a companion or ask for its help. None if they name none, else the error of an
/// executable that does not start.
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
    Some(Err(companion.become_executable(options)))
}

/// A companion answers a shell itself. `words` are the executable, `--`, and the line that is completed.
pub fn answer_shell(words: &[OsString]) {
    let Some(companion) = words.get(3).and_then(|word| find(word)) else { return };
    if env::var_os(VARIABLE).is_none() || words.len() < 5 {
        return;
    }
    let hidden = usize::from(!companion.is_one_of_many);
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
    /// Returns why that is impossible.
    fn become_executable(&self, options: Vec<OsString>) -> Failure {
        let name = self.is_one_of_many.then(|| self.name.into());
        become_executable(self.executable, name.into_iter().chain(options))
    }

    /// Help, completions and the manual page show it.
    pub fn command(&self) -> clap::Command {
        let words = Arg::new("words")
            .num_args(0..)
            .allow_hyphen_values(true)
            .help(format!("Those of {}: firsthand {} --help", self.executable, self.name));
        clap::Command::new(self.name).about(self.about).disable_help_flag(true).arg(words)
    }
}

/// The executable is beside this one or on PATH. Returns why that is impossible.
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
