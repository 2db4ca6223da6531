//! `firsthand logs`: the logs of a run, merged by time.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
    thread,
};

use clap::Args;
use common::domain::RobotName;
use console::{logs::Logs, robots::Robot, runs};

use super::{
    Failure,
    echo::Waiting,
    error_code::Refused,
    operate,
    stream::{LOOK_EVERY, Stream},
};

/// Print the logs of a run, those of all its processes merged by time.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Of this process alone: a stage, `supervisor` or `x80-sim`.
    stage: Option<String>,
    /// Go on with what is written, and with the robot's next run, until Ctrl-C.
    #[arg(short, long, conflicts_with = "run")]
    follow: bool,
    /// Name of the robot: its run that goes on, or else its newest below --runs.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// Where the directories of runs are.
    #[arg(long, value_name = "DIR", default_value = "runs")]
    runs: PathBuf,
    /// The directory of the run.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["robot", "runs"])]
    run: Option<PathBuf>,
}

pub(crate) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let mut stream = Stream::open()?;
    if arguments.follow {
        follow(arguments, &mut stream)?;
        return Ok(ExitCode::SUCCESS);
    }
    let directory = match &arguments.run {
        Some(directory) => directory.clone(),
        None => newest(arguments).ok_or_else(|| {
            let (robot, runs) = (&arguments.robot, arguments.runs.display());
            format!("no run of robot {robot} goes on or is kept in {runs}; name its directory with --run, or see `firsthand runs`")
        })?,
    };
    let mut logs = opened(arguments, &directory)?;
    print_round(&mut logs, &mut stream)?;
    Ok(ExitCode::SUCCESS)
}

/// The robot's run that goes on, or else its newest that is kept.
fn newest(arguments: &Arguments) -> Option<PathBuf> {
    let robot = &arguments.robot;
    Robot::find(robot.clone()).run.or_else(|| {
        let kept = runs::list(&arguments.runs).into_iter();
        let newest = kept.filter(|run| run.robot == *robot).max();
        newest.map(|run| run.directory)
    })
}

/// The logs in `directory`, that of the process asked for among them.
fn opened(arguments: &Arguments, directory: &Path) -> Result<Logs, Failure> {
    let stage = arguments.stage.as_deref();
    let unreadable = |error| format!("cannot read logs in {}: {error}", directory.display());
    let processes = Logs::processes(directory).map_err(unreadable)?;
    if let Some(stage) = stage.filter(|stage| !processes.iter().any(|it| it == stage)) {
        let (directory, there) = (directory.display(), processes.join(", "));
        let message = format!("{stage:?} has no log in {directory}; there are {there}");
        return Err(Refused::new("unknown-process", message).into());
    }
    Ok(Logs::of(directory, stage))
}

/// Print what the robot's runs log, one after the other.
fn follow(arguments: &Arguments, stream: &mut Stream) -> Result<(), Failure> {
    // Its log may not be there yet.
    if let Some(stage) = arguments.stage.as_deref()
        && !OTHERS.contains(&stage)
    {
        operate::known(stage)?;
    }
    let mut waiting = Waiting::default();
    let mut followed: Option<(PathBuf, Logs)> = None;
    while !stream.has_ended() {
        let goes_on = Robot::find(arguments.robot.clone()).run;
        if let Some((directory, logs)) = &mut followed {
            // What was written until it ended was written before that was seen.
            match print_round(logs, stream) {
                // It was removed.
                Err(_) if !directory.exists() => followed = None,
                printed => printed?,
            }
        }
        match goes_on {
            Some(directory) if followed.as_ref().is_none_or(|(last, _)| *last != directory) => {
                waiting.on_connected();
                let logs = Logs::of(&directory, arguments.stage.as_deref());
                followed = Some((directory, logs));
            }
            Some(_) => thread::sleep(LOOK_EVERY),
            None => {
                waiting.on_disconnected(&arguments.robot);
                thread::sleep(LOOK_EVERY);
            }
        }
    }
    Ok(())
}

fn print_round(logs: &mut Logs, stream: &mut Stream) -> std::io::Result<()> {
    logs.look()?;
    let mut text = String::new();
    while let Some(line) = logs.next_line()? {
        text += &format!("{line}\n");
        if text.len() >= PRINTED_AT_ONCE {
            stream.write(&std::mem::take(&mut text))?;
            if stream.has_ended() {
                return Ok(());
            }
        }
    }
    stream.write(&text)
}

/// Processes of a run that are no stages.
const OTHERS: [&str; 2] = ["supervisor", "x80-sim"];
/// Lines are written together up to so many bytes.
const PRINTED_AT_ONCE: usize = 64 << 10;
