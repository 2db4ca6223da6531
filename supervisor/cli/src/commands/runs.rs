use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    process::ExitCode,
    time::{SystemTime, UNIX_EPOCH},
};

use clap::{Args, Subcommand};
use common::domain::RobotName;
use serde::Serialize;

use super::diff;
use console::{
    failure::Result,
    output::print_rows,
    runs::{self, Ended, RunDirectory, Target},
    table::Table,
    words,
};

/// List runs, remove the oldest, find where two differ.
///
/// Without a subcommand: `firsthand runs list`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    list: List,
}

#[derive(Debug, Subcommand)]
enum Command {
    List(List),
    Diff(diff::Arguments),
    /// List the results of a run's targets, even in progress.
    ///
    /// Prints place, outcome, mission time, and final distance, as estimated and true.
    Targets {
        /// Directory of the run.
        run: PathBuf,
        /// Print one JSON object per line.
        #[arg(long)]
        json: bool,
    },
}

/// List runs with outcome and size, the newest last.
///
/// With --prune, first remove the oldest.
#[derive(Debug, Args)]
struct List {
    /// Directory that holds the directories of runs.
    #[arg(long, value_name = "DIR", default_value = "runs")]
    runs: PathBuf,
    /// List only the runs of this robot.
    #[arg(long)]
    robot: Option<RobotName>,
    /// First remove all but the newest N ended runs per robot.
    #[arg(long, value_name = "N")]
    prune: Option<usize>,
    /// Print one JSON object per line.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Listed<'a> {
    run: &'a Path,
    robot: &'a RobotName,
    mission: Option<&'a str>,
    outcome: String,
    mission_time_s: Option<f64>,
    targets: Vec<Target>,
    /// Seconds since 1970, UTC.
    began_s: f64,
    size_bytes: u64,
}

pub fn main(arguments: &Arguments) -> Result<ExitCode> {
    match &arguments.command {
        None => list(&arguments.list)?,
        Some(Command::List(arguments)) => list(arguments)?,
        Some(Command::Diff(arguments)) => return diff::main(arguments),
        Some(Command::Targets { run, json }) => targets(run, *json)?,
    }
    Ok(ExitCode::SUCCESS)
}

fn targets(run: &Path, json: bool) -> Result {
    let targets = runs::targets(run);
    if targets.is_empty() {
        return Err(format!("no target of {} has a result", run.display()).into());
    }
    let mut table = Table::new([">target", ">x", ">y", "outcome", ">at", ">off", ">in truth"]);
    let with = |value: Option<f64>, unit: &str| {
        value.map_or("-".to_owned(), |value| format!("{value:.2} {unit}"))
    };
    for target in &targets {
        table.row([
            &target.number.to_string(),
            &with(Some(target.x_m), "m"),
            &with(Some(target.y_m), "m"),
            &target.outcome.replace('_', " "),
            &with(target.at_s, "s"),
            &with(target.distance_m, "m"),
            &with(target.truth_m, "m"),
        ]);
    }
    print_rows(&targets, json, table)
}

fn list(arguments: &List) -> Result {
    let runs = &arguments.runs;
    if !runs.is_dir() {
        return Err(format!(
            "directory {} does not exist; name another with --runs",
            runs.display()
        )
        .into());
    }
    let chosen = || {
        let wanted =
            |run: &RunDirectory| arguments.robot.as_ref().is_none_or(|it| *it == run.robot);
        runs::list(runs).into_iter().filter(wanted)
    };
    if let Some(keep) = arguments.prune {
        let robots: BTreeSet<_> = chosen().map(|run| run.robot).collect();
        for robot in robots {
            runs::prune(runs, &robot, keep);
        }
    }
    let mut chosen: Vec<_> = chosen().collect();
    chosen.sort();
    let listed: Vec<_> = chosen.iter().map(listed).collect();
    print_rows(&listed, arguments.json, table(&listed))
}

fn listed(run: &RunDirectory) -> Listed<'_> {
    let Ended { outcome, mission_time_s, targets } = run.outcome();
    let began = run.began.duration_since(UNIX_EPOCH).unwrap_or_default();
    let so_far = runs::targets(&run.directory);
    Listed {
        run: &run.directory,
        robot: &run.robot,
        mission: run.mission.as_deref(),
        outcome,
        mission_time_s,
        targets: if so_far.is_empty() { targets } else { so_far },
        began_s: began.as_secs_f64(),
        size_bytes: run.size(),
    }
}

fn table(listed: &[Listed<'_>]) -> String {
    let mut table =
        Table::new(["run", "robot", "mission", ">began", "outcome", ">targets", ">time", ">size"]);
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let mut all = 0;
    for run in listed {
        let began = (now.as_secs_f64() - run.began_s).max(0.0);
        let time = run.mission_time_s.map_or("-".to_owned(), |time_s| format!("{time_s:.1} s"));
        let reached = run.targets.iter().filter(|it| it.outcome == "reached").count();
        let targets = match run.targets.len() {
            0 => "-".to_owned(),
            all => format!("{reached} of {all}"),
        };
        table.row([
            &run.run.file_name().unwrap_or_default().to_string_lossy(),
            run.robot,
            &run.mission.unwrap_or("-"),
            &(words::age(Some(began)) + " ago"),
            &run.outcome,
            &targets,
            &time,
            &words::size(run.size_bytes),
        ]);
        all += run.size_bytes;
    }
    let runs = if listed.len() == 1 { "run" } else { "runs" };
    format!("{table}{} {runs}, {}\n", listed.len(), words::size(all))
}
