//! The runs that are kept: directories below one, each with a run file.

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

/// Marks a run directory whose run was cut off, once that was reported.
pub(crate) const CUT_OFF: &str = "cut-off";
/// A summary takes 2 kB.
const LARGEST_SUMMARY: u64 = 1 << 20;

/// A run that is kept.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct RunDirectory {
    /// When it began.
    pub(crate) began: SystemTime,
    /// Where it is.
    pub(crate) directory: PathBuf,
    /// Whose it is.
    pub(crate) robot: RobotName,
    /// The mission's name; none where the run file is another version's.
    pub(crate) mission: Option<String>,
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Outcome {
    /// It has not.
    Running,
    /// Its supervisor was killed, or the machine was switched off.
    CutOff,
    /// It came to its end; what its summary says.
    Ended {
        /// `reached` and the like.
        outcome: String,
        /// Seconds of the robot's clock.
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
        // What else a run file says may be another version's.
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
    /// Whether it came to its end, or was reported as cut off: nobody goes on with it.
    pub(crate) fn has_ended(&self) -> bool {
        self.has(SUMMARY) || self.has(CUT_OFF)
    }

    fn has(&self, file: &str) -> bool {
        self.directory.join(file).exists()
    }

    /// How it ended.
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
            Some(Ok(summary)) => Outcome::Ended {
                outcome: summary.outcome,
                mission_time_s: summary.mission_time_s,
            },
            _ if self.has(SUMMARY) => Outcome::Ended {
                outcome: "unreadable".to_owned(),
                mission_time_s: None,
            },
            _ if self.is_running() => Outcome::Running,
            _ => Outcome::CutOff,
        }
    }

    fn is_running(&self) -> bool {
        let its = Robot::find(self.robot.clone()).run;
        its.is_some() && its == fs::canonicalize(&self.directory).ok()
    }

    /// What it takes on the disk, bytes.
    pub(crate) fn size(&self) -> u64 {
        size(&self.directory, MOST_LEVELS)
    }
}

/// A run directory has one level.
const MOST_LEVELS: u32 = 8;

fn size(directory: &Path, levels: u32) -> u64 {
    let entries = fs::read_dir(directory).into_iter().flatten().flatten();
    let sizes = entries.filter_map(|entry| {
        // Of a link its own: what it leads to is not the run's.
        let file = entry.metadata().ok()?;
        let below = if file.is_dir() && levels > 0 {
            size(&entry.path(), levels - 1)
        } else {
            0
        };
        // The kernel counts blocks of 512 bytes whatever the file system's are.
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
            let run = "robot = 'kept-runs'\n[mission]\nname = 'trap'";
            fs::write(directory.join(run::FILE_NAME), run).unwrap();
            directory
        };
        fs::create_dir(runs.path().join("no-run")).unwrap();
        let summary = r#"{"outcome":"timeout","mission_time_s":2.5,"new":[]}"#;
        fs::write(begun("a-ended").join(SUMMARY), summary).unwrap();
        fs::write(begun("b-broken").join(SUMMARY), "{").unwrap();
        begun("c-cut");
        let mut kept = list(runs.path());
        kept.sort_by_key(|run| run.directory.clone());
        let outcomes: Vec<_> = kept.iter().map(RunDirectory::outcome).collect();
        let ended = |outcome: &str, mission_time_s| Outcome::Ended {
            outcome: outcome.to_owned(),
            mission_time_s,
        };
        let expected = [
            ended("timeout", Some(2.5)),
            ended("unreadable", None),
            Outcome::CutOff,
        ];
        assert_eq!(outcomes, expected);
        assert_eq!(kept[0].mission.as_deref(), Some("trap"));
        assert!(kept[0].size() >= 1024, "{}", kept[0].size());
        let ended: Vec<_> = kept.iter().map(RunDirectory::has_ended).collect();
        assert_eq!(ended, [true, true, false]);
    }
}
