//! What can go wrong with a report.

use std::{
    io,
    path::{Path, PathBuf},
};

use recording::RecordingError;
use thiserror::Error;

/// What can go wrong with a report.
#[derive(Debug, Error)]
pub enum ReportError {
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The file system refused.
    #[error("cannot {action} {file}: {source}")]
    File {
        /// What was tried.
        action: &'static str,
        file: PathBuf,
        /// What the system reports.
        source: io::Error,
    },
}

pub(crate) fn failed(action: &'static str, file: &Path) -> impl FnOnce(io::Error) -> ReportError {
    let file = file.to_path_buf();
    move |source| ReportError::File {
        action,
        file,
        source,
    }
}
