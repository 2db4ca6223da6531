//! What can go wrong with a recording.

use std::{io, path::PathBuf};

use common::bus::BusError;
use thiserror::Error;

/// What can go wrong with a recording.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file system refused.
    #[error("cannot {action} recording {file}: {source}")]
    File {
        /// What was tried.
        action: &'static str,
        /// The file.
        file: PathBuf,
        /// What the system reports.
        source: io::Error,
    },
    /// The file cannot be written any more.
    #[error("cannot write recording {file}: {problem}; is the disk full?")]
    Write {
        /// The file.
        file: PathBuf,
        /// What the writer reports.
        problem: String,
    },
    /// A directory without a recording.
    #[error("{0} holds no recording.mcap: give a run that was recorded, or a recording")]
    NoRecording(PathBuf),
    /// A directory with several.
    #[error(
        "{directory} holds several recordings, of a run that was resumed: give one of them, up to {last}"
    )]
    Several {
        /// The directory.
        directory: PathBuf,
        /// The last of them.
        last: PathBuf,
    },
    /// It is not a recording of ours.
    #[error("{file} is no recording of firsthand: {problem}; `firsthand record` makes one")]
    Foreign {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// A message is not what its topic carries.
    #[error(
        "{file} holds a message on {topic:?} that this version does not know; read it with the version that wrote it"
    )]
    Message {
        /// The file.
        file: PathBuf,
        /// The topic.
        topic: String,
    },
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
}
