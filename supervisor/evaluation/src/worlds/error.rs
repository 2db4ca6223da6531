//! Why worlds cannot be had.

use std::{
    io,
    path::{Path, PathBuf},
};

use crate::maps::MapError;
use common::mission::MissionError;
use thiserror::Error;

/// Worlds that cannot be had.
#[derive(Debug, Error)]
pub enum WorldError {
    /// The file system refused.
    #[error("cannot read {}: {source}; give a kind of world, a file or a folder, see `firsthand help evaluate-worlds`", file.display())]
    Unreadable {
        /// What was given.
        file: PathBuf,
        /// The system's word.
        source: io::Error,
    },
    /// It is not what its name says.
    #[error("{}: {problem}", file.display())]
    Malformed {
        /// The file.
        file: PathBuf,
        /// What is wrong, and what to do.
        problem: String,
    },
    /// A map that cannot be read.
    #[error(transparent)]
    Map(#[from] MapError),
    /// A map of more than a building.
    #[error("{}: {side_m:.0} m on a side, a world has at most {most_m:.0} m; crop the map", file.display())]
    TooLarge {
        /// The map.
        file: PathBuf,
        /// Its longer side, metres.
        side_m: f64,
        /// The longest that is taken, metres.
        most_m: f64,
    },
    /// Start and target were given for worlds that have their own.
    #[error("--start and --target are for ROS maps; give one to --worlds, or leave them out")]
    NoMap,
    /// No mission can be made of it.
    #[error(transparent)]
    Mission(#[from] MissionError),
    /// Nothing there that a body of that size can cross.
    #[error(
        "none of the worlds can be crossed by a body of {swept_m:.2} m around its centre; give others, or a smaller robot"
    )]
    Unsolvable {
        /// Half the width of the narrowest way, metres.
        swept_m: f64,
    },
}

impl WorldError {
    pub(super) fn unreadable(file: &Path) -> impl Fn(io::Error) -> Self {
        let file = file.to_path_buf();
        move |source| Self::Unreadable {
            file: file.clone(),
            source,
        }
    }

    pub(super) fn malformed(file: &Path, problem: impl Into<String>) -> Self {
        Self::Malformed {
            file: file.to_path_buf(),
            problem: problem.into(),
        }
    }
}
