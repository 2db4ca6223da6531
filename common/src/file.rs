//! The error of a file that cannot be used, the replacement of a file, what is written behind its end, and its text.

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

/// A kill leaves the old content or the new one. Fails when the directory cannot be written.
pub fn replace(file: &Path, content: impl AsRef<[u8]>) -> io::Result<()> {
    let mut new = file.as_os_str().to_owned();
    new.push(".new");
    fs::write(&new, content)?;
    fs::rename(&new, file)
}

/// The file, which is made if there is none, to write behind its end.
pub fn append(file: impl AsRef<Path>) -> io::Result<fs::File> {
    fs::File::options().create(true).append(true).open(file)
}

/// The beginning of a text file, at most `most` bytes; none if it cannot be read.
pub fn text(file: &Path, most: u64) -> Option<String> {
    let mut text = String::new();
    fs::File::open(file).ok()?.take(most).read_to_string(&mut text).ok()?;
    Some(text)
}
