//! Missions of an evaluation, several at a time: each in one process or its own `firsthand run`.

use std::{
    collections::BTreeSet,
    fs,
    num::NonZero,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::{Mutex, mpsc::channel},
    thread,
    time::{Duration, Instant},
};

use common::clock::Pace;
use console::{missions, output::write_stderr, progress_line::ProgressLine};
use simulation::Scenario;
use summary::Summary;

use super::{
    HARMONIC, Setting,
    results::Results,
    row::{Latency, Outcome, Row},
    trial::Trial,
};
use crate::{
    error::{OrCannot as _, Result},
    robot::{self, Run},
};

const PICTURE: &str = "picture.svg";
const PAGE: &str = "report/report.html";
const LINE_EVERY: Duration = Duration::from_secs(10);

pub struct Plan {
    pub trials: Vec<Trial>,
    pub settings: Vec<Setting>,
    pub repeats: u64,
    pub noise: NoiseSeeds,
    /// Noise seed whose missions get pictures even without failure.
    pub pictured_seed: Option<u64>,
    pub jobs: Option<NonZero<usize>>,
    pub pace: Pace,
    /// After a failed calibration the mission runs uncalibrated.
    pub calibrates: bool,
    /// Whether every mission is driven by real processes.
    pub processes: bool,
}

#[derive(Clone, Copy)]
pub enum NoiseSeeds {
    /// Same seeds for every world: this one and the following.
    Counted(u64),
    /// Own seed for every mission, derived from the seed of the set.
    Derived(u64),
}

impl NoiseSeeds {
    fn seed(self, number: u64, repeats: u64, repeat: u64) -> u64 {
        match self {
            Self::Counted(first) => first.wrapping_add(repeat),
            Self::Derived(set) => {
                let mission = number.wrapping_mul(repeats).wrapping_add(repeat);
                let set = mixed(mixed(set as u32) ^ (set >> 32) as u32);
                mixed(set.wrapping_add(mission as u32)).into()
            }
        }
    }
}

/// Hashes `bits` invertibly: odd multiplications and shifts, as in MurmurHash3's finaliser (A.
/// Appleby, 2011).
const fn mixed(bits: u32) -> u32 {
    let bits = (bits ^ (bits >> 16)).wrapping_mul(0x85eb_ca6b);
    let bits = (bits ^ (bits >> 13)).wrapping_mul(0xc2b2_ae35);
    bits ^ (bits >> 16)
}

/// Returns the picture's path. A failure's page is beside it, with the extension `html`.
pub fn picture(row: &Row) -> PathBuf {
    let folder = if row.is_success() { "pictures" } else { "failures" };
    let name = format!("{}-{}-{}.svg", row.world, row.seed, row.setting);
    Path::new(folder)
        .join(name.replace(|c: char| !(c.is_ascii_alphanumeric() || "-_.".contains(c)), "_"))
}

/// Runs all missions of `plan` without rows in `results`.
///
/// # Errors
/// A file cannot be written, or `firsthand` does not start.
pub fn run(plan: &Plan, results: &mut Results, title: &str) -> Result {
    let directory = results.directory.clone();
    let pictures = plan.pictured_seed.map(|_| "pictures");
    for folder in ["worlds", "failures"].into_iter().chain(pictures) {
        let folder = directory.join(folder);
        fs::create_dir_all(&folder).or_cannot_file("make", &folder)?;
    }
    // An aborted mission reflects the machine rather than navigation, so it is run again.
    let settled = results.rows.rows.iter().filter(|row| row.outcome != Outcome::Aborted);
    let done: BTreeSet<_> = settled.map(Row::key).collect();
    let (mut all, mut left) = (0, Vec::new());
    for (number, trial) in (0..).zip(&plan.trials) {
        for Trial { mission, .. } in trial.robots() {
            let file = world_file(&directory, &mission.name);
            fs::write(&file, toml::to_string(mission)?).or_cannot_file("write", &file)?;
        }
        for repeat in 0..plan.repeats {
            let seed = plan.noise.seed(number, plan.repeats, repeat);
            for setting in &plan.settings {
                all += 1;
                let is_done = |(noise, robot): (u64, &Trial)| {
                    done.contains(&(robot.mission.name.clone(), noise, setting.name.clone()))
                };
                if !(seed..).zip(trial.robots()).all(is_done) {
                    left.push(Job { plan, trial, setting, seed, directory: &directory });
                }
            }
        }
    }
    let first = all - left.len();
    let (began, mut ended, mut line) = (Instant::now(), 0, ProgressLine::new(LINE_EVERY));
    let run = |job: &Job<'_>, thread| {
        let rows = job.run(thread)?;
        let is_aborted = rows.iter().any(|(row, _)| row.outcome == Outcome::Aborted);
        if is_aborted { job.run(thread) } else { Ok(rows) }
    };
    let kept = in_parallel(left, plan.jobs, run, |_, given| {
        for (row, latency) in given? {
            // Latencies come first, so that a mission with a row has both.
            if let Some(latency) = latency {
                results.latencies.add(latency)?;
            }
            results.rows.add(row)?;
        }
        ended += 1;
        let shown = || {
            let each_s = began.elapsed().as_secs_f64() / ended as f64;
            let left_s = each_s * (all - first - ended) as f64;
            format!("{} of {all} missions, {left_s:.0} s left", first + ended)
        };
        line.update(title, shown, true);
        Ok(())
    });
    line.end();
    kept
}

fn world_file(directory: &Path, world: &str) -> PathBuf {
    directory.join("worlds").join(format!("{world}.toml"))
}

/// Runs `jobs` on numbered threads, by default one per processor, and takes each with its result in
/// order of completion.
///
/// # Errors
/// Returns the first error of `take`; no further job begins.
pub fn in_parallel<Job: Send, Done: Send>(
    jobs: Vec<Job>,
    threads: Option<NonZero<usize>>,
    work: impl Fn(&Job, usize) -> Result<Done> + Sync,
    mut take: impl FnMut(Job, Result<Done, String>) -> Result,
) -> Result {
    let threads = threads.or(thread::available_parallelism().ok()).map_or(1, NonZero::get);
    let (queue, (give, results)) = (Mutex::new(jobs.into_iter()), channel());
    thread::scope(|scope| {
        for number in 0..threads {
            let (give, queue, work) = (give.clone(), &queue, &work);
            scope.spawn(move || {
                while let Some(job) = queue.lock().ok().and_then(|mut queue| queue.next()) {
                    let done = work(&job, number).map_err(|error| error.to_string());
                    if give.send((job, done)).is_err() {
                        break;
                    }
                }
            });
        }
        drop(give);
        results.into_iter().try_for_each(|(job, done)| take(job, done))
    })
}

struct Job<'a> {
    plan: &'a Plan,
    trial: &'a Trial,
    setting: &'a Setting,
    seed: u64,
    directory: &'a Path,
}

struct Robot<'a> {
    job: &'a Job<'a>,
    trial: &'a Trial,
    seed: u64,
    name: &'a str,
    directory: PathBuf,
    set: Vec<String>,
}

impl Robot<'_> {
    fn firsthand(&self, subcommand: &str) -> Command {
        let file = world_file(self.job.directory, &self.trial.mission.name);
        let mut command = robot::mission(subcommand, &file, self.name, &self.set);
        command.args(["--seed", &self.seed.to_string()]);
        command
    }

    fn calibrate(&mut self) -> Result {
        let runs = self.directory.with_extension("calibration");
        let file = self.directory.with_extension("calibration.toml");
        let mut calibrate = self.firsthand("calibrate");
        calibrate.args(["--set", "simulation.other='none'"]);
        calibrate.arg("--runs").arg(runs).arg("--out").arg(&file);
        let ended = calibrate.stdout(Stdio::null()).output().or_cannot("start a calibration")?;
        if ended.status.success() {
            let file = toml::Value::from(file.to_string_lossy().into_owned());
            self.set.push(format!("robot.calibration={file}"));
        } else {
            let said = String::from_utf8_lossy(&ended.stderr);
            let why = said.lines().last().unwrap_or("it gave no reason");
            let (world, seed) = (&self.trial.mission.name, self.seed);
            write_stderr(&format!(
                "\n{world}, seed {seed}: calibration failed, the mission uses the stated robot: {why}\n"
            ));
        }
        Ok(())
    }

    /// Drives the mission of a robot alone in one process, which is equal to real processes in
    /// lockstep. Returns `None` for a mission that needs those.
    fn in_one_process(&self) -> Result<Option<Summary>> {
        let Job { plan, setting, directory, .. } = *self.job;
        if plan.processes || plan.pace != Pace::Max || setting.planner != HARMONIC {
            return Ok(None);
        }
        let file = world_file(directory, &self.trial.mission.name);
        let mut mission = missions::load(&file.to_string_lossy(), &self.set)?;
        mission.seed = self.seed;
        Ok(Scenario::lockstep(&mission).run().summary)
    }

    fn start(&self, records: bool) -> Result<Run> {
        let mut command = self.firsthand("run");
        command.args(["--pace", &self.job.plan.pace.to_string(), "--out"]).arg(&self.directory);
        Run::start(command, &self.directory, records)
    }
}

impl Job<'_> {
    /// Runs the robots' missions at once. A robot without a summary has no latencies.
    fn run(&self, worker: usize) -> Result<Vec<(Row, Option<Latency>)>> {
        let Self { plan, trial, setting, seed, directory: all } = *self;
        let files = all.join(format!("run-{worker}"));
        let _ = fs::remove_dir_all(&files);
        fs::create_dir(&files).or_cannot_file("make", &files)?;
        let names =
            ["evaluate", "oncoming"].map(|robot| format!("{robot}{}-{worker}", std::process::id()));
        let mut robots: Vec<Robot<'_>> = Vec::new();
        let others = names.iter().rev();
        for (((trial, seed), name), other) in trial.robots().zip(seed..).zip(&names).zip(others) {
            let mut set = setting.set.clone();
            if self.trial.oncoming.is_some() {
                set.push(format!("simulation.other='{other}'"));
            }
            robots.push(Robot { job: self, trial, seed, name, directory: files.join(name), set });
        }
        if plan.calibrates {
            robots.iter_mut().try_for_each(Robot::calibrate)?;
        }
        // A failed or pictured mission runs again through processes, for its picture and page.
        let mut records = plan.pace != Pace::Max;
        if let [robot] = &robots[..]
            && plan.pictured_seed != Some(seed)
            && let Some(summary) = robot.in_one_process()?
        {
            let row = Row::new(robot.trial, robot.seed, setting, &summary);
            if row.is_success() {
                return Ok(vec![(row, None)]);
            }
            records = true;
        }
        let run = |records| -> Result<Vec<Run>> {
            let started: Result<Vec<_>> = robots.iter().map(|robot| robot.start(records)).collect();
            started?.into_iter().map(|run| run.wait(|| ())).collect()
        };
        let mut rows = Vec::new();
        for (robot, run) in robots.iter().zip(run(records)?) {
            let summary = run.summary();
            let has_summary = summary.is_ok();
            let summary = summary.unwrap_or_else(|reason| {
                let reason = reason.to_string();
                Summary { reason, ..Summary::default() }
            });
            let row = Row::new(robot.trial, robot.seed, setting, &summary);
            let latency = has_summary.then(|| Latency::new(&row, &summary));
            if !row.is_success() || plan.pictured_seed == Some(seed) {
                let _ = fs::rename(robot.directory.join(PICTURE), all.join(picture(&row)));
            }
            rows.push((row, latency));
        }
        let paged = robots
            .iter()
            .zip(&rows)
            .filter(|(_, (row, _))| !matches!(row.outcome, Outcome::Success | Outcome::Aborted));
        // Recording every mission would take too much space; in lockstep a rerun is bit-equal.
        if !records && paged.clone().next().is_some() {
            for robot in &robots {
                let _ = fs::remove_dir_all(&robot.directory);
            }
            run(true)?;
        }
        for (robot, (row, _)) in paged {
            let kept = all.join(picture(row)).with_extension("html");
            let _ = fs::rename(robot.directory.join(PAGE), kept);
        }
        let _ = fs::remove_dir_all(&files);
        Ok(rows)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn no_two_missions_of_a_set_have_the_same_noise_nor_do_those_of_neighbouring_sets() {
        let repeats = 10;
        let of = |set: u64| {
            let noise = NoiseSeeds::Derived(set);
            let missions = (0..300).flat_map(move |world| (0..repeats).map(move |it| (world, it)));
            missions.map(move |(world, repeat)| noise.seed(world, repeats, repeat))
        };
        let sets = [21, 22, 23, 24];
        let seeds: HashSet<u64> = sets.into_iter().flat_map(of).collect();
        assert_eq!(seeds.len(), sets.len() * 300 * 10);
        let counted = NoiseSeeds::Counted(5);
        assert_eq!((counted.seed(0, 3, 2), counted.seed(9, 3, 2)), (7, 7));
    }
}
