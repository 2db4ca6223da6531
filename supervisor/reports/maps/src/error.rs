use std::{
    io,
    path::{Path, PathBuf},
};

use thiserror::Error;

use super::map::MOST_BOXES;

#[derive(Debug, Error)]
#[error("{}: {problem}", file.display())]
pub struct MapError {
    file: PathBuf,
    problem: String,
}

impl MapError {
    /// Makes an error whose `problem` names the remedy.
    pub(crate) fn of(file: &Path, problem: impl Into<String>) -> Self {
        Self { file: file.to_owned(), problem: problem.into() }
    }

    pub(crate) fn unreadable(file: &Path) -> impl Fn(io::Error) -> Self {
        move |cause| Self::of(file, format!("{cause}; give a map file that can be read"))
    }

    pub fn too_many_boxes(file: &Path) -> Self {
        Self::of(
            file,
            format!(
                "its walls need more than {MOST_BOXES} boxes; give a map with larger cells or straighter walls"
            ),
        )
    }
}
