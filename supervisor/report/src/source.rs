//! Recordings of a run, and its summary.

use std::path::{Path, PathBuf};

use common::{file, run::Run};
use recording::{Recording, RecordingError};
use serde_json::{Map, Value};

/// Greatest size of a summary, bytes; real ones take 2 kB.
const LARGEST_SUMMARY: u64 = 1 << 20;

pub(crate) struct Source {
    /// Parts of the run in order; never empty.
    pub(crate) files: Vec<PathBuf>,
    is_run: bool,
}

impl Source {
    pub(crate) fn find(run: &Path) -> Result<Self, RecordingError> {
        Ok(Self { files: recording::files(run)?, is_run: run.is_dir() })
    }

    pub(crate) fn default_out(&self) -> PathBuf {
        let file = &self.files[0];
        if self.is_run {
            return file.with_file_name("report");
        }
        let mut name = file.file_stem().unwrap_or_default().to_owned();
        name.push("-report");
        file.with_file_name(name)
    }
}

pub(crate) fn summary(recording: &Recording) -> Option<Map<String, Value>> {
    let file = run_directory(recording)?.join("summary.json");
    serde_json::from_str(&file::text(&file, LARGEST_SUMMARY)?).ok()
}

pub(crate) fn run_directory(recording: &Recording) -> Option<&Path> {
    let directory = recording.path.parent()?;
    // The directory may belong to another run.
    (Run::load(directory).ok()? == recording.run).then_some(directory)
}
