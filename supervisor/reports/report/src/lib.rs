//! Report of a run: the robot's page with the recording in it, one self-contained file.
//!
//! ```no_run
//! let report = report::write("runs/obstacle-course-1".as_ref(), None)?;
//! println!("{}", report.display());
//! # Ok::<(), recording::RecordingError>(())
//! ```
//!
//! A recording is read once. The page has a bounded number of rows, maps and fields; metrics count
//! all.

mod beliefs;
mod content;
mod measured;
mod metrics;
pub mod shortest_path;
mod source;
#[cfg(test)]
mod tests;

use std::{
    fs,
    path::{Path, PathBuf},
};

use common::file::FileError;
use recording::RecordingError;

use self::content::Content;

pub const PAGE: &str = "report.html";

/// Writes the report of `run`, a run's directory or a recording, into `out`. Returns the page's
/// path.
///
/// Default of `out`: `report` in the run's directory, or `F-report` beside the recording `F.mcap`.
pub fn write(run: &Path, out: Option<&Path>) -> Result<PathBuf, RecordingError> {
    let files = recording::files(run)?;
    let out = out.map_or_else(|| source::default_out(run, &files[0]), Path::to_path_buf);
    let content = Content::read(&files)?;
    fs::create_dir_all(&out).map_err(FileError::of("make", &out))?;
    let page = out.join(PAGE);
    fs::write(&page, content.html()).map_err(|error| {
        // An incomplete page is useless.
        let _ = fs::remove_file(&page);
        FileError::of("write", &page)(error)
    })?;
    Ok(page)
}
