//! Errors of reports.

use std::{
    io,
    path::{Path, PathBuf},
};

use recording::RecordingError;
use thiserror::Error;

#[derive(Debug, Error)]
pub enum ReportError {
    #[error(transparent)]
    Recording(#[from] RecordingError),
    #[error("cannot {action} {file}: {source}")]
    File { action: &'static str, file: PathBuf, source: io::Error },
}

pub(crate) fn failed(action: &'static str, file: &Path) -> impl FnOnce(io::Error) -> ReportError {
    let file = file.to_path_buf();
    move |source| ReportError::File { action, file, source }
}
