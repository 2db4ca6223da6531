//! The report of a run: the robot's page with the recording in it, one file that refers to nothing else.
//!
//! ```no_run
//! let report = report::write("runs/obstacle-course-1".as_ref(), None)?;
//! println!("{}", report.display());
//! # Ok::<(), recording::RecordingError>(())
//! ```
//!
//! A recording is read once, and the page has a bounded number of rows, maps and fields; metrics count all.
//!
//! | module | holds |
//! |---|---|
//! | `source` | the recordings of the run, and its summary |
//! | `content` | the page and the metrics of the recordings |
//! | `measured` | metrics of the recording itself |
//! | `beliefs` | the map at a few moments, and the field of each |
//! | `metrics` | the table of metrics, under their field names |
//! | [`shortest_path`] | the shortest path of a body through known shapes |

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

use self::{content::Content, source::Source};

pub const PAGE: &str = "report.html";

/// Write the report of `run`, a run's directory or a recording, into `out`: by default `report` in the run's directory, or
/// `F-report` beside the recording `F.mcap`. Returns the path of the page.
pub fn write(run: &Path, out: Option<&Path>) -> Result<PathBuf, RecordingError> {
    let source = Source::find(run)?;
    let out = out.map_or_else(|| source.default_out(), Path::to_path_buf);
    let content = Content::read(&source)?;
    fs::create_dir_all(&out).map_err(FileError::of("make", &out))?;
    let page = out.join(PAGE);
    fs::write(&page, html(content)).map_err(|error| {
        // An incomplete page is of no use.
        let _ = fs::remove_file(&page);
        FileError::of("write", &page)(error)
    })?;
    Ok(page)
}

fn html(content: Content) -> String {
    let metrics = metrics::rows(&content);
    content.html(metrics)
}
