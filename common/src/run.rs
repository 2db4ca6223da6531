//! What the supervisor tells the stages of a run: one TOML file in the run directory.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{address::Address, clock::MissionClock, domain::RobotName, mission::Mission};

/// The file's name in the run directory.
pub const FILE_NAME: &str = "run.toml";

/// A run, as its stages need to know it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Whose bus to join.
    pub robot: RobotName,
    /// Where the robot answers, and over what.
    pub address: Address,
    /// How samples are stamped.
    pub clock: MissionClock,
    /// What to do.
    pub mission: Mission,
}

/// A run file that cannot be used.
#[derive(Debug, Error)]
pub enum RunError {
    /// The file system refused.
    #[error("cannot {action} {file}: {source}; is the run directory there and writable?")]
    File {
        /// What was tried.
        action: &'static str,
        /// The file.
        file: PathBuf,
        /// The system's word.
        source: std::io::Error,
    },
    /// It is not what a supervisor writes.
    #[error("{file} is not a run file: {problem}; start the stage through `firsthand run`")]
    Content {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        problem: String,
    },
}

impl Run {
    /// Write it into `directory`.
    ///
    /// # Errors
    /// When the directory does not take it.
    pub fn save(&self, directory: &Path) -> Result<(), RunError> {
        let file = directory.join(FILE_NAME);
        let text = toml::to_string(self).map_err(|error| RunError::Content {
            file: file.clone(),
            problem: error.to_string(),
        })?;
        std::fs::write(&file, text).map_err(|source| RunError::File {
            action: "write",
            file,
            source,
        })
    }

    /// Read it back from `directory`.
    ///
    /// # Errors
    /// When it is missing or not what [`Run::save`] writes.
    pub fn load(directory: &Path) -> Result<Self, RunError> {
        let file = directory.join(FILE_NAME);
        let text = std::fs::read_to_string(&file).map_err(|source| RunError::File {
            action: "read",
            file: file.clone(),
            source,
        })?;
        toml::from_str(&text).map_err(|error| RunError::Content {
            file,
            problem: error.message().to_owned(),
        })
    }
}
