//! `firsthand runs`: the runs that are kept.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    process::ExitCode,
    time::{SystemTime, UNIX_EPOCH},
};

use clap::Args;
use common::domain::RobotName;
use console::{
    runs::{self, Outcome, RunDirectory},
    words,
};
use serde::Serialize;

use super::{Failure, directories, print_text};

/// List the runs that are kept, the newest last: outcome, size; or remove the oldest.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Where the directories of runs are.
    #[arg(long, value_name = "DIR", default_value = "runs")]
    runs: PathBuf,
    /// Those of this robot alone.
    #[arg(long)]
    robot: Option<RobotName>,
    /// First remove the oldest runs that ended, beyond N of each robot.
    #[arg(long, value_name = "N")]
    prune: Option<usize>,
    /// One JSON object a line.
    #[arg(long)]
    json: bool,
}

/// A line.
#[derive(Serialize)]
struct Listed<'a> {
    run: &'a Path,
    robot: &'a RobotName,
    mission: Option<&'a str>,
    outcome: String,
    mission_time_s: Option<f64>,
    /// Seconds since 1970, UTC.
    began_s: f64,
    size_bytes: u64,
}

pub(crate) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let runs = &arguments.runs;
    if !runs.is_dir() {
        return Err(format!(
            "there is no directory {}; say where with --runs",
            runs.display()
        )
        .into());
    }
    if let Some(keep) = arguments.prune {
        for robot in robots(arguments) {
            directories::prune(runs, &robot, keep);
        }
    }
    let mut kept = kept(arguments);
    kept.sort();
    let listed: Vec<_> = kept.iter().map(listed).collect();
    let text = if arguments.json {
        let lines = listed.iter().map(serde_json::to_string);
        lines
            .map(|line| Ok(line? + "\n"))
            .collect::<serde_json::Result<String>>()?
    } else {
        table(&listed)
    };
    print_text(&text)?;
    Ok(ExitCode::SUCCESS)
}

fn kept(arguments: &Arguments) -> Vec<RunDirectory> {
    let mut kept = runs::list(&arguments.runs);
    if let Some(robot) = &arguments.robot {
        kept.retain(|run| run.robot == *robot);
    }
    kept
}

/// The robots whose runs are kept, each once.
fn robots(arguments: &Arguments) -> BTreeSet<RobotName> {
    kept(arguments).into_iter().map(|run| run.robot).collect()
}

fn listed(run: &RunDirectory) -> Listed<'_> {
    let (outcome, mission_time_s) = match run.outcome() {
        Outcome::Running => ("running".to_owned(), None),
        Outcome::CutOff => ("cut off".to_owned(), None),
        Outcome::Ended {
            outcome,
            mission_time_s,
        } => (outcome, mission_time_s),
    };
    let began = run.began.duration_since(UNIX_EPOCH).unwrap_or_default();
    Listed {
        run: &run.directory,
        robot: &run.robot,
        mission: run.mission.as_deref(),
        outcome,
        mission_time_s,
        began_s: began.as_secs_f64(),
        size_bytes: run.size(),
    }
}

fn table(listed: &[Listed<'_>]) -> String {
    let row = |cells: [&str; 7]| {
        let [run, robot, mission, began, outcome, time, size] = cells;
        format!(
            "{run:<24} {robot:<16} {mission:<18} {began:>12} {outcome:<12} {time:>9} {size:>9}\n"
        )
    };
    let mut text = row([
        "run", "robot", "mission", "began", "outcome", "time", "size",
    ]);
    let now = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    let mut all = 0;
    for run in listed {
        let began = (now.as_secs_f64() - run.began_s).max(0.0);
        let time = run
            .mission_time_s
            .map_or("-".to_owned(), |time_s| format!("{time_s:.1} s"));
        let name = run.run.file_name().unwrap_or_default().to_string_lossy();
        text += &row([
            &name,
            &run.robot.to_string(),
            run.mission.unwrap_or("-"),
            &(words::age(Some(began)) + " ago"),
            &run.outcome,
            &time,
            &words::size(run.size_bytes),
        ]);
        all += run.size_bytes;
    }
    let runs = if listed.len() == 1 { "run" } else { "runs" };
    text + &format!("{} {runs}, {}\n", listed.len(), words::size(all))
}
