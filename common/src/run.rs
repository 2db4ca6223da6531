//! Run file: the supervisor's TOML input to the stages, in the run directory. Beside it are the
//! stages' generation counts.

use std::{
    io,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{
    VERSION,
    address::Address,
    clock::MissionClock,
    domain::RobotName,
    file::{FileError, append_bytes, read_text, replace},
    mission::Mission,
};

pub const FILE_NAME: &str = "run.toml";

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    pub robot: RobotName,
    pub address: Address,
    pub clock: MissionClock,
    pub mission: Mission,
}

#[derive(Debug, Error)]
pub enum RunError {
    #[error("{0}; check that the run directory exists and is writable")]
    File(#[from] FileError),
    #[error("{file} is not a run file: {problem}; start the stage through `firsthand run`")]
    Content { file: PathBuf, problem: String },
    #[error(
        "firsthand {by} wrote {file}, which this firsthand {VERSION} cannot read ({problem}); use that version, or start a new run"
    )]
    OtherVersion { file: PathBuf, by: String, problem: String },
}

const WRITTEN_BY: &str = "firsthand";

impl Run {
    pub fn save(&self, directory: &Path) -> Result<(), RunError> {
        let file = directory.join(FILE_NAME);
        let text = toml::to_string(self).map_err(|error| RunError::Content {
            file: file.clone(),
            problem: error.to_string(),
        })?;
        let text = format!("{WRITTEN_BY} = {VERSION:?}\n{text}");
        Ok(replace(&file, &text).map_err(FileError::of("write", &file))?)
    }

    /// Fails if the file is unreadable or invalid, or from another version with other keys.
    pub fn load(directory: &Path) -> Result<Self, RunError> {
        let file = directory.join(FILE_NAME);
        Self::parse(&read_text(&file).map_err(FileError::of("read", &file))?, &file)
    }

    pub fn parse(text: &str, file: &Path) -> Result<Self, RunError> {
        toml::from_str(text).map_err(|error| {
            let file = file.to_owned();
            let problem = error.message().to_owned();
            let by = toml::from_str(text).ok().and_then(|run: toml::Table| {
                let by = run.get(WRITTEN_BY)?.as_str()?;
                (by != VERSION).then(|| by.to_owned())
            });
            match by {
                Some(by) => RunError::OtherVersion { file, by, problem },
                None => RunError::Content { file, problem },
            }
        })
    }
}

/// Returns the number of a new generation of `stage`, from 1. It continues in a resumed run,
/// because readers drop older generations.
///
/// Each generation appends a line, which is atomic and faster on a slow disk than replacing a file.
pub fn next_generation(directory: &Path, stage: &str) -> Result<u32, RunError> {
    let file = directory.join(format!("{stage}.generations"));
    let count = || {
        let count = append_bytes(&file, b"\n")?;
        u32::try_from(count).map_err(|_| io::Error::other(format!("too many generations: {count}")))
    };
    Ok(count().map_err(FileError::of("count a generation in", &file))?)
}

pub fn checkpoint_file(directory: &Path, process: &str) -> PathBuf {
    directory.join(format!("{process}.checkpoint"))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_run_file_of_another_version_is_read_or_refused_by_its_version() {
        let directory = tempfile::tempdir().unwrap();
        let run = Run {
            robot: "x80".parse().unwrap(),
            address: Address::Ros2(Some(7)),
            clock: MissionClock::Ticks { period_ns: 1 },
            mission: Mission::parse("target = [3, 0]", "m.toml").unwrap(),
        };
        run.save(directory.path()).unwrap();
        assert_eq!(Run::load(directory.path()).unwrap(), run);
        let file = directory.path().join(FILE_NAME);
        let text = fs::read_to_string(&file).unwrap();
        let later = text.replacen(VERSION, "99.0.0", 1);
        let load = |text: &str| {
            fs::write(&file, text).unwrap();
            Run::load(directory.path())
        };
        assert_eq!(load(&later).unwrap(), run);
        let misspelt = |text: &str| text.replace("[mission]", "[mission]\nspeeed = 3");
        let refused = load(&misspelt(&later)).unwrap_err();
        assert!(matches!(refused, RunError::OtherVersion { .. }), "{refused}");
        let said = refused.to_string();
        assert!(said.contains("99.0.0") && said.contains("speeed"), "{said}");
        let refused = load(&misspelt(&text)).unwrap_err();
        assert!(matches!(refused, RunError::Content { .. }), "{refused}");
    }

    #[test]
    fn generations_are_counted_on_by_the_next_supervisor() {
        let directory = tempfile::tempdir().unwrap();
        let numbers: Vec<_> =
            (0..3).map(|_| next_generation(directory.path(), "mapper").unwrap()).collect();
        assert_eq!(numbers, [1, 2, 3]);
        assert_eq!(next_generation(directory.path(), "planner").unwrap(), 1);
    }
}
