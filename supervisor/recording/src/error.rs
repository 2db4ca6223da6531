use std::path::PathBuf;

use common::{bus::BusError, file::FileError, run::RunError};
use thiserror::Error;

pub(crate) type Result<T = (), E = RecordingError> = std::result::Result<T, E>;

#[derive(Debug, Error)]
pub enum RecordingError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("cannot write recording {file}: {problem}; is the disk full?")]
    Write { file: PathBuf, problem: String },
    #[error("{0} holds no recording.mcap; give a recorded run or a recording")]
    NoRecording(PathBuf),
    #[error(
        "{directory} contains several recordings, because the run was resumed or has a disk budget; give one of them; the newest is {last}"
    )]
    Several { directory: PathBuf, last: PathBuf },
    #[error("{file} is not a recording of firsthand: {problem}; `firsthand record` makes one")]
    Foreign { file: PathBuf, problem: String },
    #[error(
        "{file} contains a message on {topic:?} that this version cannot read; use the version that wrote it"
    )]
    Message { file: PathBuf, topic: String },
    #[error(
        "{file} contains samples {schema:?} whose fields differ from those of this version; use the version that its record `run` names"
    )]
    Schema { file: PathBuf, schema: String },
    #[error(transparent)]
    Run(#[from] RunError),
    #[error(transparent)]
    Bus(#[from] BusError),
}
