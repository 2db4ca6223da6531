//! The report of a run, from its recording: one page that refers to nothing else, and each figure as an SVG file.
//!
//! ```no_run
//! let report = report::write("runs/obstacle-course-1".as_ref(), None)?;
//! println!("{}", report.display());
//! # Ok::<(), report::ReportError>(())
//! ```
//!
//! A recording is read once, whatever its length, and what is kept of it is bounded: of very many samples every second one is
//! dropped, again and again; metrics count all. Text that comes from the file is escaped wherever it goes.
//!
//! | module | holds |
//! |---|---|
//! | `source` | which recordings are of the run, and the summary beside them |
//! | `kept` | samples of a bounded number |
//! | `content` | what is read of the recordings |
//! | `events` | deaths, recoveries, and what else happened |
//! | `measured` | metrics of the recording itself |
//! | `beliefs` | the map at a few moments, and the field of each |
//! | `metrics` | the table of metrics, under their field names |
//! | `figures` | each figure |
//! | `page` | the page |
//! | `error` | what can go wrong |

mod beliefs;
mod content;
mod downsampled;
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

use self::{content::Content, error::failed, source::Source};

/// The page's name in the directory of a report.
pub const PAGE: &str = "report.html";

/// Write the report of `run`, a run's directory or a recording, into `out`: by default `report` in the run's directory, or
/// `F-report` beside the recording `F.mcap`. The page.
pub fn write(run: &Path, out: Option<&Path>) -> Result<PathBuf, ReportError> {
    let source = Source::find(run)?;
    let out = out.map_or_else(|| source.default_out(), Path::to_path_buf);
    let content = Content::read(&source)?;
    fs::create_dir_all(&out).map_err(failed("make", &out))?;
    let figures = figures::all(&content);
    for figure in &figures {
        save(&out.join(format!("{}.svg", figure.name)), &figure.svg)?;
    }
    let page = out.join(PAGE);
    save(&page, &page::html(&content, &figures))?;
    Ok(page)
}

/// Half a file is none.
fn save(file: &Path, text: &str) -> Result<(), ReportError> {
    fs::write(file, text).map_err(|error| {
        let _ = fs::remove_file(file);
        failed("write", file)(error)
    })
}
