//! The run file, TOML in the run directory, tells the stages of a run what to do. Beside it is the count of each stage's generations.

use std::{
    fs,
    io::{self, Write as _},
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{
    address::Address,
    clock::MissionClock,
    domain::RobotName,
    file::{append, replace},
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
    #[error("cannot {action} {file}: {source}; is the run directory there and writable?")]
    File { action: &'static str, file: PathBuf, source: io::Error },
    #[error("{file} is not a run file: {problem}; start the stage through `firsthand run`")]
    Content { file: PathBuf, problem: String },
}

impl Run {
    pub fn save(&self, directory: &Path) -> Result<(), RunError> {
        let file = directory.join(FILE_NAME);
        let text = toml::to_string(self).map_err(|error| RunError::Content {
            file: file.clone(),
            problem: error.to_string(),
        })?;
        replace(&file, &text).map_err(|source| RunError::File { action: "write", file, source })
    }

    /// Fails when the file cannot be read or is no run file.
    pub fn load(directory: &Path) -> Result<Self, RunError> {
        let file = directory.join(FILE_NAME);
        let text = fs::read_to_string(&file).map_err(|source| RunError::File {
            action: "read",
            file: file.clone(),
            source,
        })?;
        toml::from_str(&text)
            .map_err(|error| RunError::Content { file, problem: error.message().to_owned() })
    }
}

/// The number of a new generation of `stage`, from 1. It counts on in a resumed run, because readers drop samples of older generations.
/// Each generation appends a line, which is atomic, and a slow disk delays it less than replacing a file. Fails when the file cannot be
/// read or written.
pub fn next_generation(directory: &Path, stage: &str) -> Result<u32, RunError> {
    let file = directory.join(format!("{stage}.generations"));
    let count = || {
        let mut lines = append(&file)?;
        lines.write_all(b"\n")?;
        let count = lines.metadata()?.len();
        u32::try_from(count).map_err(|_| io::Error::other(format!("{count} generations")))
    };
    count().map_err(|source| RunError::File {
        action: "count a generation in",
        file: file.clone(),
        source,
    })
}

pub fn checkpoint_file(directory: &Path, process: &str) -> PathBuf {
    directory.join(format!("{process}.checkpoint"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn generations_are_counted_on_by_the_next_supervisor() {
        let directory = tempfile::tempdir().unwrap();
        let numbers: Vec<_> =
            (0..3).map(|_| next_generation(directory.path(), "mapper").unwrap()).collect();
        assert_eq!(numbers, [1, 2, 3]);
        assert_eq!(next_generation(directory.path(), "planner").unwrap(), 1);
    }
}
