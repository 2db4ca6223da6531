//! Errors of worlds.

use std::{
    io,
    path::{Path, PathBuf},
};

use common::mission::MissionError;
use maps::MapError;
use thiserror::Error;

#[derive(Debug, Error)]
pub enum WorldError {
    #[error("cannot read {}: {source}; give a kind of world, a file or a folder, see `firsthand help evaluation`", file.display())]
    Unreadable { file: PathBuf, source: io::Error },
    #[error("{}: {problem}", file.display())]
    Malformed { file: PathBuf, problem: String },
    #[error(transparent)]
    Map(#[from] MapError),
    #[error("{}: {side_m:.0} m on a side, a world has at most {most_m:.0} m; crop the map", file.display())]
    TooLarge { file: PathBuf, side_m: f64, most_m: f64 },
    /// Start and target were given for worlds that have their own.
    #[error("--start and --target are for ROS maps; give one to --worlds, or leave them out")]
    NoMap,
    #[error(transparent)]
    Mission(#[from] MissionError),
    /// A body of that size can cross no world of the source.
    #[error(
        "none of the worlds can be crossed by a body of {swept_m:.2} m around its centre; give others, or a smaller robot"
    )]
    Unsolvable {
        /// Half the width of the narrowest passage, metres.
        swept_m: f64,
    },
}

impl WorldError {
    pub fn unreadable(file: &Path) -> impl Fn(io::Error) -> Self {
        let file = file.to_path_buf();
        move |source| Self::Unreadable { file: file.clone(), source }
    }

    pub fn malformed(file: &Path, problem: impl Into<String>) -> Self {
        Self::Malformed { file: file.to_path_buf(), problem: problem.into() }
    }
}
