//! The missions of an evaluation: each a `firsthand run` of its own, several at a time.

use std::{
    fs, io,
    path::{Path, PathBuf},
    process::Stdio,
    sync::{Mutex, mpsc::channel},
    thread,
};

use supervisor::process::firsthand;
use thiserror::Error;

use crate::{
    latency::Latency,
    results::Results,
    row::{Outcome, Row},
    setting::Setting,
    summary::Summary,
    table::TableError,
    trial::Trial,
};

/// Name of the picture that a run leaves in its directory.
const PICTURE: &str = "picture.svg";

/// What to run.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The worlds.
    pub trials: Vec<Trial>,
    /// Every one of them on every world.
    pub settings: Vec<Setting>,
    /// Noise seeds on every world.
    pub repeats: u64,
    /// The first noise seed.
    pub seed: u64,
    /// Whether every world has the same noise seeds; else they are counted on from one world to the next.
    pub same_seeds: bool,
    /// Besides those of failures, the pictures of missions with this noise seed are kept.
    pub pictured_seed: Option<u64>,
    /// Missions at once.
    pub jobs: usize,
    /// Where worlds, rows and pictures of failures go; exists.
    pub directory: PathBuf,
}

/// Why an evaluation ended early.
#[derive(Debug, Error)]
pub enum RunnerError {
    /// The table.
    #[error(transparent)]
    Table(#[from] TableError),
    /// A file or a process.
    #[error("cannot {action}: {source}")]
    System {
        /// What was tried.
        action: String,
        /// The system's word.
        source: io::Error,
    },
}

fn system(action: impl Into<String>) -> impl FnOnce(io::Error) -> RunnerError {
    let action = action.into();
    move |source| RunnerError::System { action, source }
}

/// How far it is.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Missions that ended, those of an earlier part among them.
    pub ended: usize,
    /// All missions.
    pub all: usize,
    /// Missions that this part has ended.
    pub ended_now: usize,
}

/// One mission to run.
struct Job<'a> {
    trial: &'a Trial,
    setting: &'a Setting,
    seed: u64,
}

impl Plan {
    /// Where the mission file of a trial lies.
    fn mission_file(&self, trial: &Trial) -> PathBuf {
        let name = format!("{}.toml", trial.world);
        self.directory.join("worlds").join(name)
    }

    /// Where the picture of a mission lies, if it was kept.
    #[must_use]
    pub fn picture(&self, row: &Row) -> PathBuf {
        self.directory.join(picture(row))
    }

    fn keeps_picture(&self, row: &Row) -> bool {
        row.outcome != Outcome::Success || self.pictured_seed == Some(row.seed)
    }

    fn jobs(&self) -> impl Iterator<Item = Job<'_>> {
        let worlds = (0..).zip(&self.trials);
        worlds.flat_map(move |(number, trial)| {
            let first = if self.same_seeds {
                self.seed
            } else {
                self.seed + number * self.repeats
            };
            (first..first + self.repeats).flat_map(move |seed| {
                let settings = self.settings.iter();
                settings.map(move |setting| Job {
                    trial,
                    setting,
                    seed,
                })
            })
        })
    }
}

/// Where the picture of a mission lies in the directory of its plan.
#[must_use]
pub fn picture(row: &Row) -> PathBuf {
    let folder = match row.outcome {
        Outcome::Success => "pictures",
        _ => "failures",
    };
    let name = format!("{}-{}-{}.svg", row.world, row.seed, row.setting);
    Path::new(folder).join(name.replace(
        |c: char| !(c.is_ascii_alphanumeric() || "-_.".contains(c)),
        "_",
    ))
}

/// Run all missions of `plan` whose rows are not in `results` yet. `watch` is told after each.
///
/// # Errors
/// When a file cannot be written. A mission that fails is a row.
pub fn run(
    plan: &Plan,
    results: &mut Results,
    watch: &mut dyn FnMut(&Progress),
) -> Result<(), RunnerError> {
    let pictures = plan.pictured_seed.map(|_| "pictures");
    for folder in ["worlds", "failures"].into_iter().chain(pictures) {
        let folder = plan.directory.join(folder);
        fs::create_dir_all(&folder).map_err(system(format!("make {}", folder.display())))?;
    }
    for trial in &plan.trials {
        let text = toml::to_string(&trial.mission).map_err(io::Error::other);
        let file = plan.mission_file(trial);
        text.and_then(|text| fs::write(&file, text))
            .map_err(system(format!("write {}", file.display())))?;
    }
    let done = results.rows.keys();
    let all = plan.jobs().count();
    let left = plan.jobs().filter(|job| {
        let key = (job.trial.world.clone(), job.seed, job.setting.name.clone());
        !done.contains(&key)
    });
    let left: Vec<Job<'_>> = left.collect();
    let mut progress = Progress {
        ended: all - left.len(),
        all,
        ended_now: 0,
    };
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
                    if give.send(mission(plan, &job, worker)).is_err() {
                        return;
                    }
                }
            });
        }
        drop(give);
        for ended in rows {
            let (row, latency) = ended?;
            // First, so that a mission whose row is there has both.
            latency.map_or(Ok(()), |latency| results.latencies.add(latency))?;
            results.rows.add(row)?;
            progress.ended += 1;
            progress.ended_now += 1;
            watch(&progress);
        }
        Ok(())
    })
}

/// One mission, in processes of its own. One that gave no summary has no latencies.
fn mission(
    plan: &Plan,
    job: &Job<'_>,
    worker: usize,
) -> Result<(Row, Option<Latency>), RunnerError> {
    let Job {
        trial,
        setting,
        seed,
    } = job;
    let own = std::process::id();
    let directory = plan.directory.join(format!("run-{worker}"));
    let mut command = firsthand(&["run", "--json"]);
    command.arg(plan.mission_file(trial));
    command.args(["--robot", &format!("evaluate{own}-{worker}")]);
    command.args(["--seed", &seed.to_string(), "--parent", &own.to_string()]);
    command.arg("--out").arg(&directory);
    for assignment in &setting.set {
        command.args(["--set", assignment]);
    }
    let output = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .output()
        .map_err(system("start a mission"))?;
    let (row, latency) = match serde_json::from_slice::<Summary>(&output.stdout) {
        Ok(summary) => {
            let row = Row::new(trial, *seed, setting, &summary);
            let latency = Latency::new(&row, &summary);
            (row, Some(latency))
        }
        Err(_) => {
            let said = String::from_utf8_lossy(&output.stderr);
            let reason = said
                .trim()
                .lines()
                .last()
                .unwrap_or("no summary")
                .to_owned();
            (Row::aborted(trial, *seed, setting, reason), None)
        }
    };
    if plan.keeps_picture(&row) {
        // A mission that could not start has none.
        let _ = fs::rename(directory.join(PICTURE), plan.picture(&row));
    }
    let _ = fs::remove_dir_all(&directory);
    Ok((row, latency))
}
