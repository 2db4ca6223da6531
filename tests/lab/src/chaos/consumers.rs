//! Consumers of one mission: hit, restarted, and ended with chaos.

use std::{
    ffi::OsString,
    fs,
    os::unix::process::CommandExt as _,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    str::FromStr,
    time::{Duration, Instant},
};

use clap::Args;
use common::{file::append, start::become_child};
use processes::{
    death::log_tail,
    executable,
    process::{self, Process},
};
use rustix::process::{Pid, Signal, kill_process_group};

use super::{options, report::Report, schedule::Kind};
use crate::error::{OrCannot as _, Result};

/// A recorder writes its last chunk within milliseconds; user programs may take longer.
const ENDS_WITHIN: Duration = Duration::from_secs(5);

#[derive(Default)]
pub struct Consumers(Vec<Running>);

struct Running {
    consumer: Consumer,
    /// Process; none after it ended by itself.
    process: Option<Process>,
    starts: u32,
    frozen_until: Option<Instant>,
    /// File of its standard error, beside its recordings.
    said: PathBuf,
}

impl Consumers {
    pub fn start(
        asked: &options::Arguments,
        directory: &Path,
        report: &mut Report,
    ) -> Result<Self> {
        fs::create_dir(directory).or_cannot("make a directory")?;
        let mut consumers = asked.consumer.clone();
        if asked.include_consumers {
            for words in [RECORD, "topic hz", "logs -f"] {
                let command = format!("firsthand {words} --robot {}", asked.robot);
                let consumer: Consumer = command.parse()?;
                consumers.push(Consumer { name: words.to_owned(), ..consumer });
            }
        }
        let mut all = Vec::new();
        for (place, consumer) in consumers.into_iter().enumerate() {
            let said = directory.join(format!("stderr-{place}"));
            let mut running =
                Running { consumer, process: None, starts: 0, frozen_until: None, said };
            running.start(report)?;
            all.push(running);
        }
        Ok(Self(all))
    }

    pub fn len(&self) -> usize {
        self.0.len()
    }

    pub fn maintain(&mut self, report: &mut Report) -> Result {
        for running in &mut self.0 {
            if running.frozen_until.is_some_and(|until| Instant::now() >= until) {
                running.thaw();
            }
            if let Some(process) = &mut running.process
                && let Some(cause) = process.try_reap().or_cannot("reap")?
            {
                running.process = None;
                let said = log_tail(&running.said, 0);
                let end = format!("{cause}: {}", said.lines().last().unwrap_or("-"));
                let name = &running.consumer.name;
                report.count(name, "ended_by_itself");
                report.last_ends.insert(name.clone(), end);
            }
        }
        Ok(())
    }

    /// Returns the consumer's name and number of starts; `None` without a signal, because it is
    /// frozen already, or had ended by itself and is restarted.
    pub fn hit(
        &mut self,
        index: usize,
        kind: Kind,
        pause: Duration,
        report: &mut Report,
    ) -> Result<Option<(String, u32)>> {
        let freezes = kind == Kind::Freeze;
        let running = &mut self.0[index];
        if running.process.is_none() {
            running.start(report)?;
            return Ok(None);
        }
        if freezes && running.frozen_until.is_some() {
            return Ok(None);
        }
        let hit = (running.consumer.name.clone(), running.starts);
        running.signal(kind.signal());
        if freezes {
            running.frozen_until = Some(Instant::now() + pause);
        } else {
            running.process = None;
            running.start(report)?;
        }
        Ok(Some(hit))
    }

    /// Ends all consumers after they write their files.
    pub fn end(&mut self) {
        for running in &mut self.0 {
            running.thaw();
            running.signal(Signal::TERM);
        }
        for mut process in self.0.drain(..).filter_map(|running| running.process) {
            process.end(ENDS_WITHIN);
        }
    }
}

impl Running {
    fn start(&mut self, report: &mut Report) -> Result {
        let Consumer { name, words } = &self.consumer;
        let own = std::process::id().to_string();
        let mut command = process::firsthand(&["bench", "consumer", &own]);
        command.args(words).stdout(Stdio::null());
        self.frozen_until = None;
        self.starts += 1;
        if name == RECORD {
            let file = format!("record-{}.mcap", self.starts);
            command.arg("--out").arg(self.said.with_file_name(file));
        }
        command.stderr(append(&self.said).or_cannot("write what a consumer says")?);
        self.process = Some(Process::spawn(command).or_cannot("start a consumer")?);
        report.count(name, "started");
        Ok(())
    }

    /// Signals the unreaped process and its descendants.
    fn signal(&self, signal: Signal) {
        if let Some(process) = &self.process
            && let Some(pid) = Pid::from_raw(process.id().cast_signed())
        {
            let _ = kill_process_group(pid, signal);
        }
    }

    fn thaw(&mut self) {
        if self.frozen_until.take().is_some() {
            self.signal(Signal::CONT);
        }
    }
}

const RECORD: &str = "record";

/// Program that reads from the bus: a subcommand of `firsthand`, or a user's command.
#[derive(Clone, Debug)]
pub struct Consumer {
    name: String,
    /// Path of the program, and its arguments.
    words: Vec<String>,
}

impl FromStr for Consumer {
    type Err = String;

    fn from_str(command: &str) -> Result<Self, String> {
        let parsed = || {
            if command.contains('\0') {
                return Err("it contains a zero byte".to_owned());
            }
            let mut words =
                shlex::split(command).ok_or("it ends within quotes or after a backslash")?;
            let program = words.first_mut().ok_or("it is empty")?;
            let found = executable::find(Path::new(&*program));
            *program =
                found.map_err(|problem| format!("{program}: {problem}"))?.display().to_string();
            Ok(Self { name: command.to_owned(), words })
        };
        parsed().map_err(|problem: String| {
            format!(
                "the consumer {command:?} cannot be started: {problem}; give the path of a program, or its name on PATH, and its \
                 arguments; quote arguments with spaces (no shell reads them)"
            )
        })
    }
}

/// Become a program that ends with the process PARENT.
#[derive(Debug, Args)]
#[command(hide = true)]
pub struct Arguments {
    parent: u32,
    /// Program and its arguments.
    #[arg(required = true, trailing_var_arg = true, allow_hyphen_values = true)]
    words: Vec<OsString>,
}

pub fn main(arguments: &Arguments) -> Result {
    let Arguments { parent, words } = arguments;
    // The kernel's signal at the parent's end survives exec.
    become_child("consumer", *parent)?;
    let error = Command::new(&words[0]).args(&words[1..]).exec();
    Err(format!("cannot execute {}: {error}", words[0].display()).into())
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
            (" \t", "it is empty"),
            ("sh\0x", "zero byte"),
        ] {
            let error = command.parse::<Consumer>().unwrap_err();
            assert!(error.contains(problem) && error.contains("give the path"), "{error}");
        }
    }

    #[test]
    fn a_command_is_its_program_and_its_words_and_nothing_is_expanded() {
        let command = "sh -c 'exit  1' \"d 'e\" f\\ g '' $HOME *.rs | `id`";
        let given: Consumer = command.parse().unwrap();
        let program = Path::new(&given.words[0]);
        assert!(program.is_absolute() && program.ends_with("sh"));
        let words = ["-c", "exit  1", "d 'e", "f g", "", "$HOME", "*.rs", "|", "`id`"];
        assert_eq!(given.words[1..], words);
        assert_eq!(given.name, command);
    }
}
