//! Runs, each a directory with a run file.

use std::{
    fs, io,
    os::unix::fs::MetadataExt as _,
    path::{Path, PathBuf},
    time::SystemTime,
};

use common::{domain::RobotName, run};
use mission_control::recovery::{self, SUMMARY};
use processes::records;
use recording::log_files::Tail;
use serde::{Deserialize, Serialize};

use super::{
    failure::{Result, refuse},
    output::say,
    robots::{Robot, entries},
};

/// Bytes for the results of 20,000 targets.
const LARGEST_TARGETS: u64 = 4 << 20;

#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct RunDirectory {
    pub began: SystemTime,
    pub directory: PathBuf,
    pub robot: RobotName,
    /// `None` if another version wrote the run file.
    pub mission: Option<String>,
}

#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub struct Ended {
    /// Word such as `reached`.
    pub outcome: String,
    pub mission_time_s: Option<f64>,
    #[serde(default)]
    pub targets: Vec<Target>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Target {
    pub number: u64,
    pub x_m: f64,
    pub y_m: f64,
    pub outcome: String,
    pub at_s: Option<f64>,
    #[serde(default)]
    pub distance_m: Option<f64>,
    #[serde(default)]
    pub truth_m: Option<f64>,
}

/// Returns the newest [`LARGEST_TARGETS`] bytes of a run's target results.
pub fn targets(directory: &Path) -> Vec<Target> {
    Results::of(directory, LARGEST_TARGETS).take()
}

/// Reader of a run's target results as they are recorded.
#[derive(Debug)]
pub struct Results {
    file: PathBuf,
    tail: Tail,
}

impl Results {
    /// Starts at the newest `most` bytes of the results in `directory`.
    pub fn of(directory: &Path, most: u64) -> Self {
        let (file, mut tail) = (directory.join(records::TARGETS), Tail::default());
        tail.skip(&file, most);
        Self { file, tail }
    }

    pub fn take(&mut self) -> Vec<Target> {
        let mut targets = Vec::new();
        loop {
            let lines = self.tail.lines(&self.file);
            if lines.is_empty() {
                return targets;
            }
            // The first line may be cut.
            targets.extend(lines.lines().filter_map(|line| serde_json::from_str(line).ok()));
        }
    }
}

pub fn list(runs: &Path) -> Vec<RunDirectory> {
    #[derive(Deserialize)]
    struct Mission {
        name: String,
    }
    #[derive(Deserialize)]
    struct Named {
        robot: RobotName,
        // Another version may have further keys.
        mission: Option<Mission>,
    }
    let read = |entry: fs::DirEntry| {
        let directory = entry.path();
        let file = directory.join(run::FILE_NAME);
        let named: Named = toml::from_str(&fs::read_to_string(&file).ok()?).ok()?;
        Some(RunDirectory {
            began: fs::metadata(file).ok()?.modified().ok()?,
            directory,
            robot: named.robot,
            mission: named.mission.map(|mission| mission.name),
        })
    };
    entries(runs).filter_map(read).collect()
}

impl RunDirectory {
    /// Returns whether the run has a summary, and thus is never continued.
    pub fn has_ended(&self) -> bool {
        self.directory.join(SUMMARY).exists()
    }

    /// Returns how the run ended, or that it is running or cut off.
    pub fn outcome(&self) -> Ended {
        let outcome = match recovery::summary(&self.directory) {
            Some(ended) => return ended,
            _ if self.has_ended() => "unreadable",
            _ if self.is_running() => "running",
            _ => "cut off",
        };
        Ended { outcome: outcome.to_owned(), ..Ended::default() }
    }

    fn is_running(&self) -> bool {
        let its = Robot::find(self.robot.clone()).run;
        its.is_some() && its == fs::canonicalize(&self.directory).ok()
    }

    pub fn size(&self) -> u64 {
        size(&self.directory, MOST_LEVELS)
    }
}

/// Counted directory levels. A run directory has one.
const MOST_LEVELS: u32 = 8;

fn size(directory: &Path, levels: u32) -> u64 {
    entries(directory)
        .filter_map(|entry| {
            // A link counts without its target.
            let file = entry.metadata().ok()?;
            let below =
                if file.is_dir() && levels > 0 { size(&entry.path(), levels - 1) } else { 0 };
            // The kernel counts blocks of 512 bytes on every file system.
            Some(file.blocks().saturating_mul(512).saturating_add(below))
        })
        .fold(0, u64::saturating_add)
}

/// Fails if the directory holds an earlier run.
pub fn own(directory: &Path) -> Result<PathBuf> {
    fs::create_dir_all(directory).map_err(|error| {
        format!("cannot make {}: {error}; give another --out", directory.display())
    })?;
    if directory.join(run::FILE_NAME).exists() {
        let directory = directory.display();
        return refuse(
            "results-there",
            format!("{directory} holds an earlier run; give an empty or new directory with --out"),
        );
    }
    Ok(fs::canonicalize(directory)?)
}

/// Makes `NAME-NNN` after the highest existing number.
pub fn numbered(runs: &Path, name: &str) -> Result<PathBuf> {
    fs::create_dir_all(runs).map_err(|error| {
        format!("cannot make {}: {error}; name another directory with --out", runs.display())
    })?;
    let number = |entry: fs::DirEntry| {
        let file_name = entry.file_name();
        file_name.to_str()?.strip_prefix(name)?.strip_prefix('-')?.parse::<u64>().ok()
    };
    let mut number = entries(runs).filter_map(number).max().unwrap_or_default() + 1;
    loop {
        let directory = runs.join(format!("{name}-{number:03}"));
        match fs::create_dir(&directory) {
            Ok(()) => return Ok(fs::canonicalize(directory)?),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => number += 1,
            Err(error) => {
                return Err(format!("cannot make {}: {error}", directory.display()).into());
            }
        }
    }
}

/// Removes all but the newest `keep` ended runs of `robot`; ignores failures.
pub fn prune(runs: &Path, robot: &RobotName, keep: usize) {
    let mut ended = runs_of(robot, runs);
    ended.retain(RunDirectory::has_ended);
    ended.sort();
    let surplus = ended.len().saturating_sub(keep);
    for RunDirectory { directory, .. } in &ended[..surplus] {
        if let Err(error) = fs::remove_dir_all(directory) {
            let directory = directory.display();
            say(format_args!("cannot remove {directory}: {error}"));
        }
    }
}

fn runs_of(robot: &RobotName, runs: &Path) -> Vec<RunDirectory> {
    let mut runs = list(runs);
    runs.retain(|run| run.robot == *robot);
    runs
}

pub fn newest(runs: &Path, robot: &RobotName) -> Option<RunDirectory> {
    runs_of(robot, runs).into_iter().max()
}

/// Returns the directory of the robot's current run, or of its newest below `runs`.
///
/// # Errors
/// Fails if it has none.
pub fn current_or_newest(runs: &Path, robot: &RobotName) -> Result<PathBuf> {
    let newest = || Some(newest(runs, robot)?.directory);
    Ok(Robot::find(robot.clone()).run.or_else(newest).ok_or_else(|| {
        format!(
            "robot {robot} has no run now and none in {}; name a run, or see `firsthand runs`",
            runs.display()
        )
    })?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_ended_says_how_and_what_was_cut_off_is_told_from_it() {
        let runs = tempfile::tempdir().unwrap();
        let begun =
            |name| begun(runs.path(), "robot = 'listed-runs'\n[mission]\nname = 'trap'", name);
        fs::create_dir(runs.path().join("no-run")).unwrap();
        let summary = r#"{"outcome":"timeout","mission_time_s":2.5,"new":[]}"#;
        fs::write(begun("a-ended").join(SUMMARY), summary).unwrap();
        fs::write(begun("b-broken").join(SUMMARY), "{").unwrap();
        begun("c-cut");
        let mut listed = list(runs.path());
        listed.sort_by_key(|run| run.directory.clone());
        let outcomes: Vec<_> = listed.iter().map(RunDirectory::outcome).collect();
        let ended = |outcome: &str, mission_time_s| Ended {
            outcome: outcome.to_owned(),
            mission_time_s,
            ..Ended::default()
        };
        let cut_off = ended("cut off", None);
        let expected = [ended("timeout", Some(2.5)), ended("unreadable", None), cut_off];
        assert_eq!(outcomes, expected);
        assert_eq!(listed[0].mission.as_deref(), Some("trap"));
        assert!(listed[0].size() >= 1024, "{}", listed[0].size());
        assert!(listed.iter().map(RunDirectory::has_ended).eq([true, true, false]));
    }

    #[test]
    fn a_target_of_another_version_is_read_by_the_keys_that_it_has() {
        let run = tempfile::tempdir().unwrap();
        let lines = r#"{"number":1,"x_m":1,"y_m":2,"outcome":"reached","at_s":3.5,"new":[]}
            {"number":2,"x_mm":1000}
            {"number":3,"x_m":1,"y_m":2,"outcome":"of another kind","at_s":null}
            "#;
        fs::write(run.path().join(records::TARGETS), lines).unwrap();
        let numbers: Vec<_> = targets(run.path()).iter().map(|target| target.number).collect();
        assert_eq!(numbers, [1, 3]);
    }

    fn begun(runs: &Path, run: &str, name: &str) -> PathBuf {
        let directory = runs.join(name);
        fs::create_dir(&directory).unwrap();
        fs::write(directory.join(run::FILE_NAME), run).unwrap();
        directory
    }

    fn x80() -> RobotName {
        "x80".parse().unwrap()
    }

    #[test]
    fn the_newest_run_is_its_robots_alone_and_has_ended_with_a_summary() {
        let runs = tempfile::tempdir().unwrap();
        let runs = runs.path();
        assert_eq!(newest(runs, &x80()), None);
        let cut = begun(runs, "robot = 'x80'", "cut");
        let file = fs::File::options().append(true).open(cut.join(run::FILE_NAME)).unwrap();
        file.set_modified(SystemTime::now() + std::time::Duration::from_secs(60)).unwrap();
        fs::write(begun(runs, "robot = 'x80'", "ended").join(SUMMARY), "").unwrap();
        begun(runs, "robot = 'other'", "others");
        let found = newest(runs, &x80()).unwrap();
        assert_eq!((&found.directory, found.has_ended()), (&cut, false));
        fs::write(cut.join(SUMMARY), "").unwrap();
        assert!(found.has_ended());
    }

    #[test]
    fn the_oldest_runs_that_ended_are_removed_and_no_other() {
        let runs = tempfile::tempdir().unwrap();
        let runs = runs.path();
        let began = SystemTime::now();
        for (age, name) in ["a-001", "a-002", "a-003"].iter().rev().enumerate() {
            let directory = begun(runs, "robot = 'x80'", name);
            fs::write(directory.join(SUMMARY), "").unwrap();
            let file = fs::File::open(directory.join(run::FILE_NAME)).unwrap();
            let minutes = std::time::Duration::from_secs(60 * age as u64);
            file.set_modified(began - minutes).unwrap();
        }
        begun(runs, "robot = 'x80'", "a-004");
        fs::write(begun(runs, "robot = 'other'", "b-001").join(SUMMARY), "").unwrap();
        prune(runs, &x80(), 1);
        let mut left: Vec<_> =
            fs::read_dir(runs).unwrap().map(|it| it.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, ["a-003", "a-004", "b-001"]);
        let next = numbered(runs, "a").unwrap();
        assert!(next.ends_with("a-005"), "{}", next.display());
    }
}
