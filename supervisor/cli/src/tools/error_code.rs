//! The codes of errors that only tools have.

use std::error::Error;

use evaluation::{directory::DirectoryError, experiments::experiment::ExperimentError};
use recording::replay::live::LiveError;
use report::ReportError;

use crate::console::failure;

/// The code of `error`; none if no script could react to the error in particular.
pub(crate) fn of(error: &(dyn Error + 'static)) -> Option<&'static str> {
    if let Some(ExperimentError::Unknown { .. }) = error.downcast_ref() {
        return Some("unknown-experiment");
    }
    if let Some(ReportError::Recording(error)) = error.downcast_ref() {
        return failure::of_recording(error);
    }
    if let Some(LiveError::Link) = error.downcast_ref() {
        return Some("never-live");
    }
    match error.downcast_ref()? {
        DirectoryError::Taken { .. } => Some("results-there"),
        DirectoryError::Another { .. } => Some("other-results"),
        DirectoryError::System { .. } => None,
    }
}
