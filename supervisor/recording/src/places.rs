use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use crate::{RecordingError, Result};

/// `F.mcap`, `F-2.mcap`, ...
pub(crate) fn numbered(out: &Path, number: u32) -> PathBuf {
    if number <= 1 {
        return out.to_path_buf();
    }
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    out.with_file_name(format!("{stem}-{number}.mcap"))
}

/// Returns the recordings in a run's directory by number. A resumed run or a full file begins
/// another.
fn taken(run: &Path) -> BTreeMap<u32, PathBuf> {
    let first = run.join("recording.mcap");
    fs::read_dir(run)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .filter_map(|path| {
            let number = path
                .file_stem()?
                .to_str()?
                .rsplit_once('-')
                .map_or(Ok(1), |(_, number)| number.parse())
                .ok()?;
            (path == numbered(&first, number)).then_some((number, path))
        })
        .collect()
}

pub fn next_place(run: &Path) -> PathBuf {
    let last = taken(run).into_keys().next_back().unwrap_or(0);
    numbered(&run.join("recording.mcap"), last.saturating_add(1))
}

/// Returns the recordings in a run's directory, in order; a disk budget removes the oldest.
pub fn parts(run: &Path) -> Vec<PathBuf> {
    taken(run).into_values().filter(|file| file.is_file()).collect()
}

/// Returns the recordings of `run`, a run's directory or one file, in order.
///
/// # Errors
/// Fails if the directory has none.
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
    fn the_next_recording_has_the_number_after_the_last_and_other_names_do_not_count() {
        let run = tempfile::tempdir().unwrap();
        let file = |name: &str| run.path().join(name);
        assert_eq!(next_place(run.path()), file("recording.mcap"));
        for number in ["10", "2", "011", "1", "+12"] {
            fs::write(file(&format!("recording-{number}.mcap")), "").unwrap();
        }
        assert_eq!(parts(run.path()), ["recording-2.mcap", "recording-10.mcap"].map(file));
        assert_eq!(next_place(run.path()), file("recording-11.mcap"));
    }
}
