//! The file of a run's summary: room for it is reserved when the run starts, so that the result is kept although the disk is
//! full by then.

use std::{
    fs::{self, File},
    io::{self, Write as _},
    path::{Path, PathBuf},
};

use rustix::{
    fs::{FallocateFlags, fallocate},
    io::Errno,
};
use supervisor::recovery::SUMMARY;

use crate::console::failure::Refused;

/// Under this name it is written: one that is called [`SUMMARY`] is whole, and says that the run has ended.
const UNFINISHED: &str = "summary.json.unfinished";
/// A summary takes 2 kB.
const ROOM: u64 = 16 << 10;

/// The file, before the run has ended.
pub(crate) struct SummaryFile {
    file: File,
    directory: PathBuf,
}

impl SummaryFile {
    /// Reserve its room in the run `directory`.
    ///
    /// # Errors
    /// When there is none.
    pub(crate) fn reserve(directory: &Path) -> Result<Self, Refused> {
        let path = directory.join(UNFINISHED);
        let reserved = File::create(&path).and_then(|file| {
            match fallocate(&file, FallocateFlags::KEEP_SIZE, 0, ROOM) {
                // This file system cannot reserve.
                Ok(()) | Err(Errno::OPNOTSUPP | Errno::NOSYS) => Ok(file),
                Err(errno) => Err(errno.into()),
            }
        });
        let file = reserved.map_err(|error| {
            let full = error.kind() == io::ErrorKind::StorageFull;
            let code = if full { "disk-full" } else { "not-writable" };
            Refused::new(code, failed("reserve room for", &path)(error))
        })?;
        Ok(Self {
            file,
            directory: directory.to_path_buf(),
        })
    }

    /// Write the summary.
    ///
    /// # Errors
    /// When the file system refuses.
    pub(crate) fn write(mut self, text: &str) -> Result<(), String> {
        let (from, to) = (
            self.directory.join(UNFINISHED),
            self.directory.join(SUMMARY),
        );
        let written = self.file.write_all(text.as_bytes());
        // What was reserved and is not needed is given back.
        let written = written.and_then(|()| self.file.set_len(text.len() as u64));
        written.map_err(failed("write", &from))?;
        fs::rename(&from, &to).map_err(failed("make", &to))
    }
}

fn failed(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> String {
    let path = path.display().to_string();
    move |error| format!("cannot {action} {path}: {error}; is the disk full?")
}
