//! Why a map could not be read.

use std::{
    io,
    path::{Path, PathBuf},
};

use harmonic::MAX_SIDE;
use thiserror::Error;

/// Why a map could not be read. Every message begins with the file.
#[derive(Debug, Error)]
pub enum MapError {
    /// The file cannot be opened or read.
    #[error("{}: {cause}; give a map file that can be read", file.display())]
    Unreadable {
        /// The map or its image.
        file: PathBuf,
        /// The system's error.
        cause: io::Error,
    },
    /// A directory, a pipe, a device.
    #[error("{}: not a regular file; give a map file", file.display())]
    NotAFile {
        /// What was given.
        file: PathBuf,
    },
    /// Nothing in the name says which kind of map it is.
    #[error(
        "{}: not the name of a map; give a .yaml of the ROS map_server, a .pgm or .png image, or a MovingAI .map",
        file.display()
    )]
    UnknownFormat {
        /// What was given.
        file: PathBuf,
    },
    /// The format says more than any map of that kind needs.
    #[error("{}: {bytes} bytes, a file of this kind has at most {most}; check that it is one", file.display())]
    TooLong {
        /// The file.
        file: PathBuf,
        /// Its length.
        bytes: u64,
        /// What is read.
        most: u64,
    },
    /// No cells, or more than the planner takes.
    #[error("{}: {cols} x {rows} cells; a map has 1 to {MAX_SIDE} on each side, so crop or scale it", file.display())]
    Size {
        /// The map or its image.
        file: PathBuf,
        /// Columns.
        cols: u64,
        /// Rows.
        rows: u64,
    },
    /// Not what its format asks for.
    #[error("{}: {problem}", file.display())]
    Malformed {
        /// The map or its image.
        file: PathBuf,
        /// What is wrong, where, and what to do.
        problem: String,
    },
}

impl MapError {
    pub(crate) fn malformed(file: &Path, problem: impl Into<String>) -> Self {
        Self::Malformed {
            file: file.to_owned(),
            problem: problem.into(),
        }
    }
}
