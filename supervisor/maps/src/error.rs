use std::{
    io,
    path::{Path, PathBuf},
};

use harmonic::MAX_SIDE;
use thiserror::Error;

use super::map::MOST_BOXES;

/// Every message begins with the file.
#[derive(Debug, Error)]
pub enum MapError {
    #[error("{}: {cause}; give a map file that can be read", file.display())]
    Unreadable { file: PathBuf, cause: io::Error },
    #[error("{}: {cause}; give the name of a map to write", file.display())]
    Unwritable { file: PathBuf, cause: io::Error },
    /// A directory, a pipe or a device.
    #[error("{}: not a regular file; give a map file", file.display())]
    NotAFile { file: PathBuf },
    #[error(
        "{}: not the name of a map; give a .yaml of the ROS map_server, a .pgm or .png image, or a MovingAI .map",
        file.display()
    )]
    UnknownFormat { file: PathBuf },
    #[error("{}: {bytes} bytes, a file of this kind has at most {most}; check that it is one", file.display())]
    TooLong { file: PathBuf, bytes: u64, most: u64 },
    #[error("{}: {cols} x {rows} cells; a map has 1 to {MAX_SIDE} on each side, so crop or scale it", file.display())]
    Size { file: PathBuf, cols: u64, rows: u64 },
    #[error("{}: {problem}", file.display())]
    Malformed { file: PathBuf, problem: String },
}

impl MapError {
    pub(crate) fn malformed(file: &Path, problem: impl Into<String>) -> Self {
        Self::Malformed { file: file.to_owned(), problem: problem.into() }
    }

    pub fn too_many_boxes(file: &Path) -> Self {
        let problem = format!(
            "its walls are more than {MOST_BOXES} boxes; give a map with larger cells or straighter walls"
        );
        Self::malformed(file, problem)
    }
}
