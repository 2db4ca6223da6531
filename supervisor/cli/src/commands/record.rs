use std::{
    fs::{self, File},
    io::{self, Read as _},
    os::fd::{AsFd, BorrowedFd},
    path::{Path, PathBuf},
    str::FromStr,
    time::Duration,
};

use clap::Args;
use common::{domain::RobotName, file::FileError, poll, signals::Signals, start::become_child};
use recording::{
    Options,
    recorder::{Happened, Wish, Wishes},
};

use super::topic::readable;
use console::{
    failure::Result,
    output::{print_line, say},
};

/// Record the topics of a robot until Ctrl-C, across runs.
///
/// `run` starts its own recorder.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Name of the robot, which may start later.
    #[arg(long, default_value_t)]
    robot: RobotName,
    /// File of the recording.
    ///
    /// The robot's next run goes into F-2.mcap beside it.
    #[arg(long, value_name = "F.mcap", default_value = "recording.mcap")]
    out: PathBuf,
    /// Record only these topics, separated by commas: `pose,ranges`.
    ///
    /// A replay needs `inputs`.
    #[arg(long, value_name = "TOPICS", value_delimiter = ',')]
    topics: Option<Vec<String>>,
    /// Also record guidance fields.
    ///
    /// Fields are larger than all other topics together.
    #[arg(long)]
    fields: bool,
    /// Largest size of all files: `500MB`, `2GB`.
    ///
    /// A new file begins at a quarter of SIZE or after an hour. The recorder removes the oldest
    /// files.
    #[arg(long, value_name = "SIZE")]
    disk_budget: Option<DiskBudget>,
    /// Directory of the one run to record.
    #[arg(long, hide = true)]
    run_directory: Option<PathBuf>,
    /// End when this parent process ends.
    #[arg(long, hide = true)]
    supervisor: Option<u32>,
}

#[derive(Clone, Copy, Debug)]
pub struct DiskBudget(pub u64);

impl FromStr for DiskBudget {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        /// Smallest budget, because a file holds all message definitions.
        const LEAST: u64 = 500_000;
        let digits = text.trim_end_matches(|letter: char| !letter.is_ascii_digit());
        let unit: Option<u64> = match &text[digits.len()..] {
            "" => Some(1),
            "kB" => Some(1_000),
            "MB" => Some(1_000_000),
            "GB" => Some(1_000_000_000),
            _ => None,
        };
        unit.and_then(|unit| digits.parse::<u64>().ok()?.checked_mul(unit))
            .filter(|bytes| *bytes >= LEAST)
            .map(Self)
            .ok_or_else(|| {
                format!("{text:?} is not a size of 500kB or more; give one such as 500MB or 2GB")
            })
    }
}

/// Creates and removes a file beside `out`; the recording may begin much later.
fn refuse_unwritable(out: &Path) -> Result<(), FileError> {
    let probe = out.with_extension(format!("{}.tmp", std::process::id()));
    File::create_new(&probe)
        .and_then(|_| fs::remove_file(&probe))
        .map_err(FileError::of("write", out))
}

struct Asks {
    signals: Signals,
    /// Pipe with one byte per request of the supervisor, which may end before its recorder.
    supervisor: Option<File>,
}

impl Wishes for Asks {
    fn next_wish(&mut self) -> Wish {
        if self.signals.came() {
            return Wish::Stop;
        }
        let asked = self
            .supervisor
            .as_mut()
            .filter(|asks| matches!(poll::is_readable(asks, Duration::ZERO), Ok(true)));
        match asked.map(|asks| asks.read(&mut [0])) {
            Some(Ok(1)) => return Wish::CatchUp,
            Some(_) => self.supervisor = None,
            None => {}
        }
        Wish::Record
    }

    fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        self.supervisor
            .as_ref()
            .map(AsFd::as_fd)
            .into_iter()
            .chain([self.signals.as_fd()])
            .collect()
    }
}

pub fn main(arguments: &Arguments) -> Result {
    let mut asks = Asks { signals: Signals::that_end()?, supervisor: None };
    if let Some(supervisor) = arguments.supervisor {
        become_child("recorder", supervisor)?;
        asks.supervisor = Some(io::stdin().as_fd().try_clone_to_owned()?.into());
    }
    let chosen = arguments
        .topics
        .as_ref()
        .map(|names| names.iter().map(|name| readable(name)).collect::<Result<_>>());
    let options = Options {
        domain: arguments.robot.domain(),
        out: arguments.out.clone(),
        topics: chosen.transpose()?,
        fields: arguments.fields,
        run: arguments.run_directory.clone(),
        budget: arguments.disk_budget.map(|DiskBudget(bytes)| bytes),
    };
    if arguments.supervisor.is_none() {
        refuse_unwritable(&arguments.out)?;
    }
    let mut tell = |happened: Happened<'_>| {
        let printed = match happened {
            Happened::Attached(file) => {
                print_line(format_args!("recording {} into {}", arguments.robot, file.display()))
            }
            Happened::CaughtUp => print_line("caught up"),
            Happened::Complete(file, lost) => {
                print_line(format_args!("{}: complete, {lost} samples lost", file.display()))
            }
        };
        if let Err(error) = printed {
            say(format_args!("cannot print the state of the recording: {error}"));
        }
    };
    Ok(recording::record(&options, &mut asks, &mut tell)?)
}
