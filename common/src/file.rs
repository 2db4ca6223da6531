//! File helpers: the error of an unusable file, replacement, appending, and bounded reading.

use std::{
    fs,
    io::{self, Read as _},
    path::{Path, PathBuf},
};

use thiserror::Error;

#[derive(Debug, Error)]
#[error("cannot {action} {}: {source}", file.display())]
pub struct FileError {
    pub action: &'static str,
    pub file: PathBuf,
    pub source: io::Error,
}

impl FileError {
    pub fn of<E: Into<io::Error>>(
        action: &'static str,
        file: &Path,
    ) -> impl FnOnce(E) -> Self + use<E> {
        let file = file.to_path_buf();
        move |cause| Self { action, file, source: cause.into() }
    }
}

/// Replaces `file` so that a kill leaves the old or the new content.
pub fn replace(file: &Path, content: impl AsRef<[u8]>) -> io::Result<()> {
    let mut new = file.as_os_str().to_owned();
    new.push(".new");
    fs::write(&new, content)?;
    fs::rename(&new, file)
}

pub fn append(file: impl AsRef<Path>) -> io::Result<fs::File> {
    fs::File::options().create(true).append(true).open(file)
}

/// Returns the first `most` bytes of a text file.
pub fn text(file: &Path, most: u64) -> Option<String> {
    let mut text = String::new();
    fs::File::open(file).ok()?.take(most).read_to_string(&mut text).ok()?;
    Some(text)
}
