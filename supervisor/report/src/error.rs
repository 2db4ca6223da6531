//! Errors of reports.

use common::file::FileError;
use recording::RecordingError;
use thiserror::Error;

#[derive(Debug, Error)]
pub enum ReportError {
    #[error(transparent)]
    Recording(#[from] RecordingError),
    #[error(transparent)]
    File(#[from] FileError),
}
