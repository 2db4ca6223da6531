mod merged;

use std::path::{Path, PathBuf};

use clap::Args;
use common::{domain::RobotName, follower::Event};

use self::merged::Logs;
use console::{
    failure::{Result, refuse},
    operator,
    robots::Robot,
    runs,
    stream::Stream,
    waiting::Waiting,
};

/// Print the logs of all processes of a run, merged by time.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Print only the log of a stage, `supervisor` or `x80-sim`.
    stage: Option<String>,
    /// Also print new lines, across runs, until Ctrl-C.
    #[arg(short, long, conflicts_with = "run")]
    follow: bool,
    /// Name of the robot.
    ///
    /// Prints its current run, or its newest run below --runs.
    #[arg(long, default_value_t)]
    robot: RobotName,
    /// Directory that holds the directories of runs.
    #[arg(long, value_name = "DIR", default_value = "runs")]
    runs: PathBuf,
    /// Directory of the run.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["robot", "runs"])]
    run: Option<PathBuf>,
}

pub fn main(arguments: &Arguments) -> Result {
    let mut stream = Stream::open()?;
    if arguments.follow {
        return follow(arguments, &mut stream);
    }
    let current = || runs::current_or_newest(&arguments.runs, &arguments.robot);
    let directory = arguments.run.clone().map_or_else(current, Ok)?;
    let mut logs = opened(arguments, &directory)?;
    Ok(print_round(&mut logs, &mut stream)?)
}

fn opened(arguments: &Arguments, directory: &Path) -> Result<Logs> {
    let stage = arguments.stage.as_deref();
    let unreadable = |error| format!("cannot read logs in {}: {error}", directory.display());
    let processes = Logs::processes(directory).map_err(unreadable)?;
    if let Some(stage) = stage.filter(|stage| !processes.iter().any(|it| it == stage)) {
        let (directory, there) = (directory.display(), processes.join(", "));
        return refuse(
            "unknown-process",
            format!("{stage:?} has no log in {directory}; there are {there}"),
        );
    }
    Ok(Logs::of(directory, stage))
}

fn follow(arguments: &Arguments, stream: &mut Stream) -> Result {
    if let Some(stage) = arguments.stage.as_deref()
        && !OTHERS.contains(&stage)
    {
        operator::known(stage)?;
    }
    let mut waiting = Waiting::default();
    let mut followed: Option<(PathBuf, Logs)> = None;
    while !stream.has_ended() {
        let goes_on = Robot::find(arguments.robot.clone()).run;
        if let Some((directory, logs)) = &mut followed {
            // Checked before, so this round prints the last lines.
            match print_round(logs, stream) {
                // The directory was removed.
                Err(_) if !directory.exists() => followed = None,
                printed => printed?,
            }
        }
        match goes_on {
            Some(directory) if followed.as_ref().is_none_or(|(last, _)| *last != directory) => {
                waiting.tell(&Event::<()>::Connected, &arguments.robot);
                let logs = Logs::of(&directory, arguments.stage.as_deref());
                followed = Some((directory, logs));
            }
            Some(_) => {}
            None => waiting.tell(&Event::<()>::Disconnected, &arguments.robot),
        }
        stream.pause()?;
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

const OTHERS: [&str; 2] = ["supervisor", "x80-sim"];
const PRINTED_AT_ONCE: usize = 64 << 10;
