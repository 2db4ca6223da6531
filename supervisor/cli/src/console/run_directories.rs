//! The directory of a run: made, found, removed.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use super::{
    failure::{Failure, Refused},
    output::write_stderr,
    runs::{self, CUT_OFF, RunDirectory},
};
use common::domain::RobotName;

/// The directory that was asked for. It is refused if it holds an earlier run.
pub(crate) fn own(directory: &Path) -> Result<PathBuf, Failure> {
    fs::create_dir_all(directory).map_err(|error| {
        format!("cannot make {}: {error}; give another --out", directory.display())
    })?;
    if directory.join(common::run::FILE_NAME).exists() {
        let message = format!(
            "{} holds an earlier run; give an empty or new directory with --out",
            directory.display()
        );
        return Err(Refused::new("results-there", message).into());
    }
    Ok(fs::canonicalize(directory)?)
}

/// `NAME-NNN` below `runs`, with the number after the highest one there.
pub(crate) fn numbered(runs: &Path, name: &str) -> Result<PathBuf, Failure> {
    fs::create_dir_all(runs).map_err(|error| {
        format!("cannot make {}: {error}; say where with --out", runs.display())
    })?;
    let mut number = highest_number(runs, name) + 1;
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

fn highest_number(runs: &Path, name: &str) -> u64 {
    let number = |entry: fs::DirEntry| {
        let file_name = entry.file_name();
        let rest = file_name.to_str()?.strip_prefix(name)?;
        rest.strip_prefix('-')?.parse().ok()
    };
    let entries = fs::read_dir(runs).into_iter().flatten().flatten();
    entries.filter_map(number).max().unwrap_or_default()
}

/// Remove the directories of all but the newest `keep` runs of `robot` that have ended. If one cannot be removed, it stays and
/// the mission starts all the same.
pub(crate) fn prune(runs: &Path, robot: &RobotName, keep: usize) {
    let mut ended = runs_of(robot, runs);
    ended.retain(RunDirectory::has_ended);
    ended.sort();
    let surplus = ended.len().saturating_sub(keep);
    for RunDirectory { directory, .. } in &ended[..surplus] {
        if let Err(error) = fs::remove_dir_all(directory) {
            let directory = directory.display();
            write_stderr(&format!("firsthand: cannot remove {directory}: {error}\n"));
        }
    }
}

fn runs_of(robot: &RobotName, runs: &Path) -> Vec<RunDirectory> {
    let mut runs = runs::list(runs);
    runs.retain(|run| run.robot == *robot);
    runs
}

/// The newest run of `robot` below `runs` that was cut off and not reported yet: it has no summary, because its supervisor was
/// killed or the machine was switched off.
pub(crate) fn cut_off(runs: &Path, robot: &RobotName) -> io::Result<Option<PathBuf>> {
    let runs = runs_of(robot, runs).into_iter();
    let newest = runs.filter(|run| !run.has_ended()).max();
    newest.map(|run| fs::canonicalize(run.directory)).transpose()
}

/// Mark that a run was reported as cut off, so that the next start begins a new one.
pub(crate) fn mark_cut_off(directory: &Path) -> io::Result<()> {
    fs::write(directory.join(CUT_OFF), "")
}

#[cfg(test)]
mod tests {
    use std::time::SystemTime;

    use supervisor::recovery::SUMMARY;

    use super::*;

    /// The directory of a run of `robot` that has begun.
    fn begun(runs: &Path, robot: &str, name: &str) -> PathBuf {
        let directory = runs.join(name);
        fs::create_dir(&directory).unwrap();
        let run = format!("robot = '{robot}'");
        fs::write(directory.join(common::run::FILE_NAME), run).unwrap();
        directory
    }

    fn x80() -> RobotName {
        "x80".parse().unwrap()
    }

    #[test]
    fn a_run_that_was_cut_off_is_reported_once_and_to_its_robot_alone() {
        let runs = tempfile::tempdir().unwrap();
        let runs = runs.path();
        fs::write(begun(runs, "x80", "ended").join(SUMMARY), "").unwrap();
        begun(runs, "other", "others");
        assert_eq!(cut_off(runs, &x80()).unwrap(), None);
        let cut = fs::canonicalize(begun(runs, "x80", "cut")).unwrap();
        assert_eq!(cut_off(runs, &x80()).unwrap(), Some(cut.clone()));
        mark_cut_off(&cut).unwrap();
        assert_eq!(cut_off(runs, &x80()).unwrap(), None, "reported again");
    }

    #[test]
    fn the_oldest_runs_that_ended_are_removed_and_no_other() {
        let runs = tempfile::tempdir().unwrap();
        let runs = runs.path();
        let began = SystemTime::now();
        for (age, name) in ["a-001", "a-002", "a-003"].iter().rev().enumerate() {
            let directory = begun(runs, "x80", name);
            fs::write(directory.join(SUMMARY), "").unwrap();
            let file = fs::File::open(directory.join(common::run::FILE_NAME)).unwrap();
            let minutes = std::time::Duration::from_secs(60 * age as u64);
            file.set_modified(began - minutes).unwrap();
        }
        begun(runs, "x80", "a-004");
        fs::write(begun(runs, "other", "b-001").join(SUMMARY), "").unwrap();
        prune(runs, &x80(), 1);
        let mut left: Vec<_> = fs::read_dir(runs).unwrap().flatten().collect();
        left.sort_by_key(fs::DirEntry::file_name);
        let left: Vec<_> = left.iter().map(fs::DirEntry::file_name).collect();
        assert_eq!(left, ["a-003", "a-004", "b-001"]);
        let next = numbered(runs, "a").unwrap();
        assert!(next.ends_with("a-005"), "{}", next.display());
    }
}
