//! Directories of a recorded run and of its report.

use std::path::{Path, PathBuf};

use common::run::Run;
use recording::Recording;

pub(crate) fn default_out(run: &Path, file: &Path) -> PathBuf {
    if run.is_dir() {
        return file.with_file_name("report");
    }
    let mut name = file.file_stem().unwrap_or_default().to_owned();
    name.push("-report");
    file.with_file_name(name)
}

pub(crate) fn run_directory(recording: &Recording) -> Option<&Path> {
    let directory = recording.path.parent()?;
    // The directory may belong to another run.
    (Run::load(directory).ok()? == recording.run).then_some(directory)
}
