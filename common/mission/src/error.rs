use std::path::PathBuf;

use thiserror::Error;

#[derive(Debug, Error)]
pub enum MissionError {
    #[error(
        "cannot read mission {file}: {source}; give a shipped name (`firsthand missions`) or a readable TOML file"
    )]
    Unreadable { file: PathBuf, source: std::io::Error },
    /// Invalid TOML: syntax, an unknown key or a wrong type.
    #[error("{file}:{line}: {problem}")]
    Syntax {
        file: PathBuf,
        /// 1-based line.
        line: usize,
        problem: String,
    },
    #[error(
        "robot.calibration: {file}: {problem}; give a file that `firsthand calibrate` wrote, or remove the key"
    )]
    Calibration { file: PathBuf, problem: String },
    #[error("{file}:{line}: {key}: {problem}; {remedy}")]
    Value {
        file: PathBuf,
        /// 1-based line of the key, or of the table that should hold it.
        line: usize,
        key: String,
        problem: String,
        remedy: String,
    },
}

impl MissionError {
    /// Formats the fault without file and line, for a value from elsewhere.
    pub fn without_place(&self) -> String {
        match self {
            Self::Unreadable { source, .. } => source.to_string(),
            Self::Syntax { problem, .. } => problem.clone(),
            Self::Calibration { .. } => self.to_string(),
            Self::Value { key, problem, remedy, .. } => format!("{key}: {problem}; {remedy}"),
        }
    }

    /// The lines may differ.
    pub fn is_same_fault(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Syntax { problem, .. }, Self::Syntax { problem: its, .. }) => problem == its,
            (Self::Value { key, problem, .. }, Self::Value { key: its_key, problem: its, .. }) => {
                (key, problem) == (its_key, its)
            }
            _ => false,
        }
    }
}
