//! The missions of an evaluation: each a `firsthand run` of its own, several at a time.

use std::{
    collections::BTreeSet,
    fs, io,
    num::NonZero,
    path::{Path, PathBuf},
    process::Stdio,
    sync::{Mutex, mpsc::channel},
    thread,
};

use common::file::FileError;
use summary::Summary;
use thiserror::Error;

use crate::{
    missions::{
        latency::Latency,
        progress::Progress,
        results::Results,
        row::{Outcome, Row},
        setting::Setting,
        table::Record as _,
        trial::Trial,
    },
    robot,
};

/// A run's picture and its page, in its directory.
const PICTURE: &str = "picture.svg";
const PAGE: &str = "report/report.html";

#[derive(Clone, Debug)]
pub struct Plan {
    pub trials: Vec<Trial>,
    pub settings: Vec<Setting>,
    /// Missions on each world for each setting, with different noise.
    pub repeats: u64,
    pub noise: NoiseSeeds,
    /// The noise seed whose missions get pictures even if they did not fail.
    pub pictured_seed: Option<u64>,
    pub jobs: usize,
    /// Whether the robot of each mission is calibrated before, as its owner would do it. If that fails the mission runs without.
    pub calibrates: bool,
    /// Directory of worlds, rows and pictures of failures; it must exist.
    pub directory: PathBuf,
}

#[derive(Clone, Copy, Debug)]
pub enum NoiseSeeds {
    /// Every world has the same seeds: this seed and the following ones.
    Counted(u64),
    /// Every mission has a seed of its own, derived from the seed of the set.
    Derived(u64),
}

impl NoiseSeeds {
    /// The noise seed of mission `repeat` of `repeats` on world `number`.
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

/// An invertible hash of `bits`: multiplications by odd numbers and shifts, as in the finaliser of MurmurHash3 (A. Appleby, 2011).
const fn mixed(bits: u32) -> u32 {
    let bits = (bits ^ (bits >> 16)).wrapping_mul(0x85eb_ca6b);
    let bits = (bits ^ (bits >> 13)).wrapping_mul(0xc2b2_ae35);
    bits ^ (bits >> 16)
}

#[derive(Debug, Error)]
pub enum RunnerError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("cannot start a mission: {0}")]
    Start(io::Error),
}

struct Job<'a> {
    trial: &'a Trial,
    setting: &'a Setting,
    seed: u64,
}

impl Plan {
    fn mission_file(&self, trial: &Trial) -> PathBuf {
        let name = format!("{}.toml", trial.world);
        self.directory.join("worlds").join(name)
    }

    fn keeps_picture(&self, row: &Row) -> bool {
        row.outcome != Outcome::Success || self.pictured_seed == Some(row.seed)
    }

    fn jobs(&self) -> impl Iterator<Item = Job<'_>> {
        let worlds = (0..).zip(&self.trials);
        worlds.flat_map(move |(number, trial)| {
            (0..self.repeats).flat_map(move |repeat| {
                let seed = self.noise.seed(number, self.repeats, repeat);
                let settings = self.settings.iter();
                settings.map(move |setting| Job { trial, setting, seed })
            })
        })
    }
}

/// Missions at once: the requested number, or one for each processor.
pub fn processors(asked_for: Option<NonZero<usize>>) -> usize {
    asked_for.map_or_else(|| thread::available_parallelism().map_or(1, NonZero::get), NonZero::get)
}

/// The path of a mission's picture in the directory of its plan.
pub fn picture(row: &Row) -> PathBuf {
    let folder = match row.outcome {
        Outcome::Success => "pictures",
        _ => "failures",
    };
    let name = format!("{}-{}-{}.svg", row.world, row.seed, row.setting);
    Path::new(folder)
        .join(name.replace(|c: char| !(c.is_ascii_alphanumeric() || "-_.".contains(c)), "_"))
}

/// The path of the page of a failure, beside its picture.
pub fn page(picture: &Path) -> PathBuf {
    picture.with_extension("html")
}

/// Run all missions of `plan` whose rows are not in `results` yet. A line on standard error, which begins with `title`, shows how far.
///
/// # Errors
/// A file cannot be written, or `firsthand` does not start.
pub fn run(plan: &Plan, results: &mut Results, title: &str) -> Result<(), RunnerError> {
    let pictures = plan.pictured_seed.map(|_| "pictures");
    for folder in ["worlds", "failures"].into_iter().chain(pictures) {
        let folder = plan.directory.join(folder);
        fs::create_dir_all(&folder).map_err(FileError::of("make", &folder))?;
    }
    for trial in &plan.trials {
        let text = toml::to_string(&trial.mission).map_err(io::Error::other);
        let file = plan.mission_file(trial);
        text.and_then(|text| fs::write(&file, text)).map_err(FileError::of("write", &file))?;
    }
    // An aborted mission says nothing about navigation, only about the machine, so it is run again.
    let settled = results.rows.rows().iter().filter(|row| row.outcome != Outcome::Aborted);
    let done: BTreeSet<_> = settled.map(Row::key).collect();
    let all = plan.jobs().count();
    let left = plan.jobs().filter(|job| {
        let key = (job.trial.world.clone(), job.seed, job.setting.name.clone());
        !done.contains(&key)
    });
    let left: Vec<Job<'_>> = left.collect();
    let mut progress = Progress::new(title, all - left.len(), all);
    let queue = Mutex::new(left.into_iter());
    let (give, rows) = channel::<Result<_, RunnerError>>();
    thread::scope(|scope| {
        for worker in 0..plan.jobs.max(1) {
            let (give, queue) = (give.clone(), &queue);
            scope.spawn(move || {
                loop {
                    let job = queue.lock().ok().and_then(|mut queue| queue.next());
                    let Some(job) = job else {
                        return;
                    };
                    let ended = match mission(plan, &job, worker) {
                        Ok((row, _)) if row.outcome == Outcome::Aborted => {
                            mission(plan, &job, worker)
                        }
                        ended => ended,
                    };
                    if give.send(ended).is_err() {
                        return;
                    }
                }
            });
        }
        drop(give);
        for ended in rows {
            let (row, latency) = ended?;
            // Latencies are written first, so that a mission with a row has both.
            latency.map_or(Ok(()), |latency| results.latencies.add(latency))?;
            results.rows.add(row)?;
            progress.count();
        }
        Ok(())
    })
}

/// Run one mission, in processes of its own. Without a summary it has no latencies.
fn mission(
    plan: &Plan,
    job: &Job<'_>,
    worker: usize,
) -> Result<(Row, Option<Latency>), RunnerError> {
    let Job { trial, setting, seed } = job;
    let own = std::process::id();
    let directory = plan.directory.join(format!("run-{worker}"));
    let robot = format!("evaluate{own}-{worker}");
    let firsthand = |subcommand: &str| {
        let file = plan.mission_file(trial);
        let mut command = robot::mission(subcommand, file, &robot, &setting.set);
        command.args(["--seed", &seed.to_string()]);
        command
    };
    let calibration = plan.directory.join(format!("calibration-{worker}"));
    let mut calibrated = None;
    if plan.calibrates {
        let file = calibration.join("calibration.toml");
        let mut calibrate = firsthand("calibrate");
        calibrate.arg("--runs").arg(&calibration).arg("--out").arg(&file);
        let ended = calibrate.stdout(Stdio::null()).stderr(Stdio::null()).status();
        if ended.map_err(RunnerError::Start)?.success() {
            let file = toml::Value::from(file.to_string_lossy().into_owned());
            calibrated = Some(format!("robot.calibration={file}"));
        }
    }
    let run = |options: &[&str]| {
        let mut command = firsthand("run");
        command.args(options).args(["--parent", &own.to_string()]);
        command.args(calibrated.iter().flat_map(|key| ["--set", key]));
        command.arg("--out").arg(&directory).output().map_err(RunnerError::Start)
    };
    let output = run(&["--no-record"])?;
    let (row, latency) = match serde_json::from_slice::<Summary>(&output.stdout) {
        Ok(summary) => {
            let row = Row::new(trial, *seed, setting, &summary);
            let latency = Latency::new(&row, &summary);
            (row, Some(latency))
        }
        Err(_) => {
            let said = String::from_utf8_lossy(&output.stderr);
            let reason = said.trim().lines().last().unwrap_or("no summary").to_owned();
            (Row::aborted(trial, *seed, setting, reason), None)
        }
    };
    let kept = plan.directory.join(picture(&row));
    if plan.keeps_picture(&row) {
        // A mission that could not start has no picture.
        let _ = fs::rename(directory.join(PICTURE), &kept);
    }
    if !matches!(row.outcome, Outcome::Success | Outcome::Aborted) {
        // The mission can be run again, to the bit, and recordings of all missions would take too much room.
        let _ = fs::remove_dir_all(&directory);
        run(&[])?;
        let _ = fs::rename(directory.join(PAGE), page(&kept));
    }
    let _ = fs::remove_dir_all(&directory);
    let _ = fs::remove_dir_all(&calibration);
    Ok((row, latency))
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
