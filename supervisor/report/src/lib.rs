//! The report of a run, from its recording: one page that refers to nothing else, and each figure as an SVG file.
//!
//! ```no_run
//! let report = report::write("runs/obstacle-course-1".as_ref(), None)?;
//! println!("{}", report.display());
//! # Ok::<(), report::ReportError>(())
//! ```
//!
//! A recording is read once, and memory is bounded: whenever there are too many samples, every second one is dropped; metrics
//! count all. Text from the file is escaped.
//!
//! | module | holds |
//! |---|---|
//! | `source` | the recordings of the run, and its summary |
//! | `content` | the data that a report takes from the recordings |
//! | `events` | deaths, recoveries and other events |
//! | `measured` | metrics of the recording itself |
//! | `beliefs` | the map at a few moments, and the field of each |
//! | `metrics` | the table of metrics, under their field names |
//! | `figures` | the figures |
//! | `page` | the page |
//! | `error` | errors |

mod beliefs;
mod content;
mod error;
mod events;
mod figures;
mod measured;
mod metrics;
mod page;
mod source;
#[cfg(test)]
mod tests;

use std::{
    fs,
    path::{Path, PathBuf},
};

pub use error::ReportError;

use common::file::FileError;

use self::{content::Content, source::Source};

/// The page's name in the directory of a report.
pub const PAGE: &str = "report.html";

/// Write the report of `run`, a run's directory or a recording, into `out`: by default `report` in the run's directory, or
/// `F-report` beside the recording `F.mcap`. Returns the path of the page.
pub fn write(run: &Path, out: Option<&Path>) -> Result<PathBuf, ReportError> {
    let source = Source::find(run)?;
    let out = out.map_or_else(|| source.default_out(), Path::to_path_buf);
    let content = Content::read(&source)?;
    fs::create_dir_all(&out).map_err(FileError::of("make", &out))?;
    let figures = figures::all(&content);
    for figure in &figures {
        save(&out.join(format!("{}.svg", figure.name)), &figure.svg)?;
    }
    let page = out.join(PAGE);
    save(&page, &page::html(&content, &figures))?;
    Ok(page)
}

/// An incomplete file is removed.
fn save(file: &Path, text: &str) -> Result<(), FileError> {
    fs::write(file, text).map_err(|error| {
        let _ = fs::remove_file(file);
        FileError::of("write", file)(error)
    })
}
