//! The runs of a directory: each is a directory with a run file.

use std::{
    fs,
    os::unix::fs::MetadataExt as _,
    path::{Path, PathBuf},
    time::SystemTime,
};

use common::{domain::RobotName, run};
use serde::Deserialize;
use supervisor::recovery::SUMMARY;

use super::robots::Robot;

/// The file that marks a run that was cut off and reported.
pub(crate) const CUT_OFF: &str = "cut-off";
/// A summary takes 2 kB; a larger file is not read.
const LARGEST_SUMMARY: u64 = 1 << 20;

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct RunDirectory {
    pub(crate) began: SystemTime,
    pub(crate) directory: PathBuf,
    pub(crate) robot: RobotName,
    /// The name of the mission; none if another version wrote the run file.
    pub(crate) mission: Option<String>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Outcome {
    Running,
    /// The supervisor was killed, or the machine was switched off.
    CutOff,
    Ended {
        /// Its outcome, such as `reached`.
        outcome: String,
        mission_time_s: Option<f64>,
    },
}

/// The runs in directories below `runs`, in no order.
pub(crate) fn list(runs: &Path) -> Vec<RunDirectory> {
    #[derive(Deserialize)]
    struct Mission {
        name: String,
    }
    #[derive(Deserialize)]
    struct Named {
        robot: RobotName,
        // Another version may have other keys beside these.
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
    let entries = fs::read_dir(runs).into_iter().flatten().flatten();
    entries.filter_map(read).collect()
}

impl RunDirectory {
    /// Whether nobody goes on with it: it has a summary, or it was reported as cut off.
    pub(crate) fn has_ended(&self) -> bool {
        self.has(SUMMARY) || self.has(CUT_OFF)
    }

    fn has(&self, file: &str) -> bool {
        self.directory.join(file).exists()
    }

    pub(crate) fn outcome(&self) -> Outcome {
        #[derive(Deserialize)]
        struct Summary {
            outcome: String,
            mission_time_s: Option<f64>,
        }
        let file = self.directory.join(SUMMARY);
        let readable = fs::metadata(&file).is_ok_and(|file| file.len() <= LARGEST_SUMMARY);
        let text = readable.then(|| fs::read_to_string(&file).ok()).flatten();
        match text.map(|text| serde_json::from_str::<Summary>(&text)) {
            Some(Ok(summary)) => {
                Outcome::Ended { outcome: summary.outcome, mission_time_s: summary.mission_time_s }
            }
            _ if self.has(SUMMARY) => {
                Outcome::Ended { outcome: "unreadable".to_owned(), mission_time_s: None }
            }
            _ if self.is_running() => Outcome::Running,
            _ => Outcome::CutOff,
        }
    }

    fn is_running(&self) -> bool {
        let its = Robot::find(self.robot.clone()).run;
        its.is_some() && its == fs::canonicalize(&self.directory).ok()
    }

    /// Its size on the disk, bytes.
    pub(crate) fn size(&self) -> u64 {
        size(&self.directory, MOST_LEVELS)
    }
}

/// Deeper directories are not counted; a run directory has one level.
const MOST_LEVELS: u32 = 8;

fn size(directory: &Path, levels: u32) -> u64 {
    let entries = fs::read_dir(directory).into_iter().flatten().flatten();
    let sizes = entries.filter_map(|entry| {
        // A link counts by itself, without the file that it leads to.
        let file = entry.metadata().ok()?;
        let below = if file.is_dir() && levels > 0 { size(&entry.path(), levels - 1) } else { 0 };
        // The kernel counts blocks of 512 bytes on every file system.
        Some(file.blocks().saturating_mul(512).saturating_add(below))
    });
    sizes.fold(0, u64::saturating_add)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_ended_says_how_and_what_was_cut_off_is_told_from_it() {
        let runs = tempfile::tempdir().unwrap();
        let begun = |name: &str| {
            let directory = runs.path().join(name);
            fs::create_dir(&directory).unwrap();
            let run = "robot = 'listed-runs'\n[mission]\nname = 'trap'";
            fs::write(directory.join(run::FILE_NAME), run).unwrap();
            directory
        };
        fs::create_dir(runs.path().join("no-run")).unwrap();
        let summary = r#"{"outcome":"timeout","mission_time_s":2.5,"new":[]}"#;
        fs::write(begun("a-ended").join(SUMMARY), summary).unwrap();
        fs::write(begun("b-broken").join(SUMMARY), "{").unwrap();
        begun("c-cut");
        let mut listed = list(runs.path());
        listed.sort_by_key(|run| run.directory.clone());
        let outcomes: Vec<_> = listed.iter().map(RunDirectory::outcome).collect();
        let ended = |outcome: &str, mission_time_s| Outcome::Ended {
            outcome: outcome.to_owned(),
            mission_time_s,
        };
        let expected = [ended("timeout", Some(2.5)), ended("unreadable", None), Outcome::CutOff];
        assert_eq!(outcomes, expected);
        assert_eq!(listed[0].mission.as_deref(), Some("trap"));
        assert!(listed[0].size() >= 1024, "{}", listed[0].size());
        let ended: Vec<_> = listed.iter().map(RunDirectory::has_ended).collect();
        assert_eq!(ended, [true, true, false]);
    }
}
