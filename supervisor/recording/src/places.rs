//! The names of recordings.

use std::path::{Path, PathBuf};

use crate::{RecordingError, Result};

/// The name of recording `number`: `F.mcap`, `F-2.mcap`, ...
pub(crate) fn numbered(out: &Path, number: u32) -> PathBuf {
    if number <= 1 {
        return out.to_path_buf();
    }
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    out.with_file_name(format!("{stem}-{number}.mcap"))
}

const MOST_PARTS: u32 = 10_000;

/// The possible files of a run's recordings, in order: a resumed run begins another, and so does a file that reached its size.
fn places(run: &Path) -> impl DoubleEndedIterator<Item = PathBuf> + use<> {
    let first = run.join("recording.mcap");
    (1..=MOST_PARTS).map(move |number| numbered(&first, number))
}

pub fn next_place(run: &Path) -> PathBuf {
    let free = places(run).rev().take_while(|file| !file.exists()).last();
    free.unwrap_or_else(|| numbered(&run.join("recording.mcap"), MOST_PARTS + 1))
}

/// The recordings in a run's directory, in order. A recorder with a disk budget removes the oldest.
pub fn parts(run: &Path) -> Vec<PathBuf> {
    places(run).filter(|file| file.is_file()).collect()
}

/// The recordings of `run`, in order and never none: those in a run's directory, or one file.
///
/// # Errors
/// When the directory has none.
pub fn files(run: &Path) -> Result<Vec<PathBuf>> {
    if !run.is_dir() {
        return Ok(vec![run.to_path_buf()]);
    }
    let files = parts(run);
    if files.is_empty() {
        return Err(RecordingError::NoRecording(run.to_path_buf()));
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_of_the_next_run_has_the_next_number() {
        let out = Path::new("/tmp/a.mcap");
        assert_eq!(numbered(out, 1), Path::new("/tmp/a.mcap"));
        assert_eq!(numbered(out, 2), Path::new("/tmp/a-2.mcap"));
    }
}
