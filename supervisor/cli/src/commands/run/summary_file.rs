//! Reserves disk space for the summary at the start.

use std::{
    fs::{self, File},
    io::{self, Write as _},
    path::{Path, PathBuf},
};

use common::file::reserved;
use mission_control::recovery::SUMMARY;
use rustix::fs::fstatvfs;

use console::failure::{Refused, refuse};

/// Incomplete summary. [`SUMMARY`] means that the run has ended.
const UNFINISHED: &str = "summary.json.unfinished";
/// Reserved bytes. A summary takes 2 kB.
const ROOM: u64 = 16 << 10;
/// Bytes for logs, checkpoints and the beginning of a recording.
const RUN_ROOM: u64 = 2 << 20;
/// Bytes per cell in the mapper's checkpoint.
const CELL_ROOM: u64 = 16;

pub const fn room_of_run(cells: usize) -> u64 {
    RUN_ROOM + CELL_ROOM * cells as u64
}

pub struct SummaryFile {
    file: File,
    directory: PathBuf,
}

impl SummaryFile {
    /// Fails unless `needed` more bytes are free in `directory`.
    pub fn reserve(directory: &Path, needed: u64) -> Result<Self, Refused> {
        let path = directory.join(UNFINISHED);
        // A resumed run has its space.
        let file = reserved(&path, ROOM).map_err(|error| {
            let full = error.kind() == io::ErrorKind::StorageFull;
            let code = if full { "disk-full" } else { "not-writable" };
            Refused::new(code, failed("reserve room for", &path)(error))
        })?;
        // Unknown free space counts as enough.
        let free = fstatvfs(&file).map_or(u64::MAX, |space| space.f_bavail * space.f_frsize);
        if free < needed {
            let _ = fs::remove_file(&path);
            let (directory, free, needed) = (directory.display(), free >> 10, needed >> 10);
            return refuse(
                "disk-full",
                format!(
                    "the disk of {directory} has {free} KiB free of the {needed} KiB that the files of a run need; remove old runs, or give another directory"
                ),
            );
        }
        Ok(Self { file, directory: directory.to_path_buf() })
    }

    pub fn write(mut self, text: &str) -> Result<(), String> {
        let (from, to) = (self.directory.join(UNFINISHED), self.directory.join(SUMMARY));
        self.file
            .write_all(text.as_bytes())
            // Releases the rest of the reserved space.
            .and_then(|()| self.file.set_len(text.len() as u64))
            .map_err(failed("write", &from))?;
        fs::rename(&from, &to).map_err(failed("make", &to))
    }
}

fn failed(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> String {
    let path = path.display().to_string();
    move |error| format!("cannot {action} {path}: {error}; is the disk full?")
}
