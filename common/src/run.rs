//! The run file, with which the supervisor tells the stages of a run what to do: TOML, in the run directory. Beside it is the
//! count of each stage's generations.

use std::{
    fs::{self, File},
    io::{self, Write as _},
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{
    address::Address, clock::MissionClock, domain::RobotName, file::replace, mission::Mission,
};

/// The file's name in the run directory.
pub const FILE_NAME: &str = "run.toml";

/// A run, as its stages need to know it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// The robot whose bus the stages join.
    pub robot: RobotName,
    /// Where the robot answers, and over which transport.
    pub address: Address,
    /// The clock that stamps samples.
    pub clock: MissionClock,
    pub mission: Mission,
}

/// A run file that cannot be used.
#[derive(Debug, Error)]
pub enum RunError {
    /// The file system refused.
    #[error("cannot {action} {file}: {source}; is the run directory there and writable?")]
    File { action: &'static str, file: PathBuf, source: io::Error },
    /// The text is not a run file.
    #[error("{file} is not a run file: {problem}; start the stage through `firsthand run`")]
    Content { file: PathBuf, problem: String },
}

impl Run {
    /// Write it into `directory`.
    pub fn save(&self, directory: &Path) -> Result<(), RunError> {
        let file = directory.join(FILE_NAME);
        let text = toml::to_string(self).map_err(|error| RunError::Content {
            file: file.clone(),
            problem: error.to_string(),
        })?;
        replace(&file, &text).map_err(|source| RunError::File { action: "write", file, source })
    }

    /// Read it back from `directory`.
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

/// The number of a new generation of `stage` in the run of `directory`: 1 for the first, and counted on when a new
/// supervisor resumes the run, since readers drop samples of older generations.
///
/// The file has a line for each generation. An append is atomic here, and a slow disk does not delay it as it would delay the
/// replacement of a file.
pub fn next_generation(directory: &Path, stage: &str) -> Result<u32, RunError> {
    let file = directory.join(format!("{stage}.generations"));
    let count = || {
        let mut lines = File::options().create(true).append(true).open(&file)?;
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

/// Where a process of the run in `directory` saves the state that its successor restores.
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
