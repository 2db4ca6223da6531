//! `both-ways`: the same mission in one process and through real processes, equal to the bit.
//!
//! Both runs are undisturbed and in lockstep. Compared are the summary, the ground truth and the
//! recorded topics. The summary's wall-clock measurements and starvation are left out.

mod recordings;

use std::{
    fs, iter,
    num::NonZero,
    path::{Path, PathBuf},
    process::ExitCode,
    time::{Duration, Instant},
};

use clap::Args;
use common::{ground_truth::GROUND_TRUTH, mission::Waypoint, poll};
use console::{
    missions,
    output::{json_lines, print_line},
    runs,
};
use mission_control::recovery::SUMMARY;
use recording::Recording;
use rustix::process::Signal;
use serde_json::{Map, Value};
use simulation::{Request, Scenario};

use crate::{
    error::{OrCannot as _, Result},
    missions::{
        runner::in_parallel,
        trial::{Trial, swept_m},
    },
    robot::{self, Run},
    simulate,
    worlds::{self, Asked},
};

const ONE_PROCESS: &str = "one-process.mcap";
/// Directory of the run through processes.
const PROCESSES: &str = "processes";
/// Targets of a mission whose robot stays.
const TARGETS: usize = 2;
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Drive missions in one process and through real processes in lockstep, and compare what their
/// stages publish.
///
/// Exits with 1 if any mission differs, and names its first difference.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Worlds, as for `evaluate`.
    #[arg(long, default_value = "rooms")]
    worlds: String,
    /// Number of worlds; default: as for `evaluate`.
    #[arg(long)]
    count: Option<usize>,
    /// Seed of the worlds; the first world's noise has the same.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Let each robot stay: it drives to the target and back to its start, is sent to the target
    /// again while it waits, and is asked to end while it waits again.
    #[arg(long)]
    stay: bool,
    /// Set a key of every mission; repeatable.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Number of missions at once; by default one per processor.
    #[arg(long)]
    jobs: Option<NonZero<usize>>,
    /// Directory that keeps missions and runs.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub fn main(arguments: &Arguments) -> Result<ExitCode> {
    let Arguments { count, seed, .. } = *arguments;
    let robot = missions::parsed("target = [1, 0]", "its missions", &arguments.set)?;
    let asked = Asked { count, seed, ends: None, swept_m: swept_m(&robot) };
    let mut found = worlds::find(&arguments.worlds, asked).map_err(|error| error.to_string())?;
    if found.trials.iter().any(|trial| trial.oncoming.is_some()) {
        return Err("two robots meet in these worlds; give worlds with one robot".into());
    }
    let own = tempfile::tempdir().or_cannot("make a directory for runs")?;
    let directory = arguments.out.as_deref().unwrap_or(own.path());
    for (number, trial) in (0..).zip(&mut found.trials) {
        trial.mission.seed = seed.wrapping_add(number);
    }
    let all = found.trials.len();
    let began = Instant::now();
    let mut differ = 0;
    let drive = |trial: &Trial, thread| Job { arguments, directory, trial, thread }.compare();
    in_parallel(found.trials, arguments.jobs, drive, |trial, compared| {
        let world = trial.mission.name;
        if let Some(difference) = compared.map_err(|error| format!("{world}: {error}"))? {
            differ += 1;
            print_line(format!("{world}: {difference}"))?;
        }
        Ok(())
    })?;
    print_line(format!(
        "{all} missions in {}, in one process and through real ones: {differ} differ, {:.0} s",
        arguments.worlds,
        began.elapsed().as_secs_f64()
    ))?;
    Ok(if differ == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

struct Job<'a> {
    arguments: &'a Arguments,
    directory: &'a Path,
    trial: &'a Trial,
    thread: usize,
}

impl Job<'_> {
    /// Returns the first difference of both ways.
    fn compare(&self) -> Result<Option<String>> {
        let mut mission = self.trial.mission.clone();
        let directory = self.directory.join(&mission.name);
        fs::create_dir_all(&directory).or_cannot_file("make", &directory)?;
        let mut sent_to = None;
        if self.arguments.stay {
            let waypoint = |at| Waypoint { at, heading_deg: None };
            mission.stay = true;
            mission.targets = [mission.target, mission.start.at].map(waypoint).to_vec();
            sent_to = Some(mission.target.into());
        }
        let file = directory.join("world.toml");
        fs::write(&file, toml::to_string(&mission)?).or_cannot_file("write", &file)?;
        let one = self.in_one_process(&file, &directory, sent_to)?;
        let many = self.through_processes(&file, &directory.join(PROCESSES), sent_to)?;
        let mut difference = one.difference(&many);
        if difference.is_none() {
            // What follows the event that decided the mission depends on how soon the supervisor
            // sees it.
            let ticks = one.summary["ticks"].as_u64().unwrap_or_default();
            let one_process = Recording::open(&directory.join(ONE_PROCESS))?;
            let processes = Recording::open(&directory.join(PROCESSES))?;
            difference = recordings::difference([&one_process, &processes], ticks)?;
        }
        if difference.is_none() && self.arguments.out.is_none() {
            let _ = fs::remove_dir_all(&directory);
        }
        Ok(difference)
    }

    fn in_one_process(
        &self,
        file: &Path,
        directory: &Path,
        sent_to: Option<[f64; 2]>,
    ) -> Result<Way> {
        let mission = missions::load(&file.to_string_lossy(), &self.arguments.set)?;
        let while_waiting = sent_to.map(Request::Goto).into_iter().collect();
        let scenario = Scenario { while_waiting, ..Scenario::lockstep(&mission) };
        let ran = simulate::record(&scenario, &directory.join(ONE_PROCESS))?;
        let broken = ran.broken.map_or(String::new(), |broken| broken.to_string());
        let (finished, summary) = ran.finished.zip(ran.summary).ok_or(broken)?;
        let summary = numbers(&serde_json::to_string(&summary)?)?;
        Ok(Way { summary, truth: json_lines(&finished.truth)? })
    }

    fn through_processes(
        &self,
        file: &Path,
        directory: &Path,
        mut sent_to: Option<[f64; 2]>,
    ) -> Result<Way> {
        let name = format!("both-ways{}-{}", std::process::id(), self.thread);
        let mut command = robot::mission("run", file, &name, &self.arguments.set);
        command.args(["--pace", "max", "--out"]).arg(directory);
        let mut run = Run::start(command, directory, true)?;
        let mut targets = self.arguments.stay.then_some(TARGETS);
        while run.process.try_reap().or_cannot("reap a mission")?.is_none() {
            if targets.is_some_and(|targets| runs::targets(directory).len() >= targets) {
                targets = match sent_to.take() {
                    // The robot has another target, unless it refused this one.
                    Some(place) => targets.map(|it| it + usize::from(send(&name, place))),
                    None => {
                        run.process.signal(Signal::TERM);
                        None
                    }
                };
            }
            poll::is_readable(&run.process, LOOK_EVERY)?;
        }
        run.summary()?;
        let read = |name: &str| {
            let file = directory.join(name);
            fs::read_to_string(&file).or_cannot_file("read", &file)
        };
        Ok(Way { summary: numbers(&read(SUMMARY)?)?, truth: read(GROUND_TRUTH)? })
    }
}

/// Returns whether the robot took the target.
fn send(robot: &str, place: [f64; 2]) -> bool {
    let [x, y] = place.map(|it| it.to_string());
    let sent = robot::firsthand(&["goto", "--robot", robot, &x, &y]).output();
    sent.is_ok_and(|sent| sent.status.success())
}

/// Returns a summary without what a machine's clock and load decide.
fn numbers(summary: &str) -> Result<Value> {
    let mut summary: Value = serde_json::from_str(summary)?;
    for measured in ["tick_latency_us", "full_solve_us"] {
        summary[measured] = Value::Null;
    }
    Ok(summary)
}

/// What came of a mission, besides its recording.
struct Way {
    summary: Value,
    /// A line for each tick.
    truth: String,
}

impl Way {
    /// Returns the first difference from `other`, whose ground truth may go on for longer.
    fn difference(&self, other: &Self) -> Option<String> {
        let both = [&self.summary, &other.summary];
        let mut keys = both.into_iter().filter_map(Value::as_object).flat_map(Map::keys);
        if let Some(key) = keys.find(|key| self.summary[*key] != other.summary[*key]) {
            let [one, many] = both.map(|summary| &summary[key]);
            return Some(format!("summary, {key}: {one} and {many}"));
        }
        let others = other.truth.lines().chain(iter::repeat(""));
        let mut lines = self.truth.lines().zip(others).enumerate();
        let (at, (one, many)) = lines.find(|(_, (one, many))| one != many)?;
        Some(format!("ground truth {at}: {one} and {many}"))
    }
}
