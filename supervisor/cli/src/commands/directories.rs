//! Where a run's files go: a directory of its own.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use super::Failure;
use supervisor::recovery::SUMMARY;

/// Marks a run directory whose run was cut off, once that was reported.
const CUT_OFF: &str = "cut-off";

/// The directory asked for; results of an earlier run are not mixed with this one's.
pub(crate) fn own(directory: &Path) -> Result<PathBuf, Failure> {
    fs::create_dir_all(directory).map_err(|error| {
        format!(
            "cannot make {}: {error}; give another --out",
            directory.display()
        )
    })?;
    if directory.join(common::run::FILE_NAME).exists() {
        return Err(format!(
            "{} holds an earlier run; give an empty or new directory with --out",
            directory.display()
        )
        .into());
    }
    Ok(fs::canonicalize(directory)?)
}

/// `NAME-NNN` below `runs`, the first number that is free.
pub(crate) fn numbered(runs: &Path, name: &str) -> Result<PathBuf, Failure> {
    fs::create_dir_all(runs).map_err(|error| {
        format!(
            "cannot make {}: {error}; say where with --out",
            runs.display()
        )
    })?;
    let mut number = 1;
    loop {
        let directory = runs.join(format!("{name}-{number:03}"));
        match fs::create_dir(&directory) {
            Ok(()) => return Ok(fs::canonicalize(directory)?),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => number += 1,
            Err(error) => {
                return Err(format!("cannot make {}: {error}", directory.display()).into());
            }
        }
    }
}

/// The newest run below `runs` without a summary whose cut was not reported yet: its supervisor was killed, or the
/// machine was switched off.
pub(crate) fn cut_off(runs: &Path) -> io::Result<Option<PathBuf>> {
    let entries = match fs::read_dir(runs) {
        Ok(entries) => entries,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error),
    };
    let mut newest = None;
    for entry in entries {
        let directory = entry?.path();
        let has = |name: &str| directory.join(name).exists();
        if has(common::run::FILE_NAME) && !has(SUMMARY) && !has(CUT_OFF) {
            let began = fs::metadata(directory.join(common::run::FILE_NAME))?.modified()?;
            newest = newest.max(Some((began, directory)));
        }
    }
    newest
        .map(|(_, directory)| fs::canonicalize(directory))
        .transpose()
}

/// Mark that a run was reported as cut off: the next start begins a new one.
pub(crate) fn mark_cut_off(directory: &Path) -> io::Result<()> {
    fs::write(directory.join(CUT_OFF), "")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_that_was_cut_off_is_reported_once() {
        let runs = tempfile::tempdir().unwrap();
        let begun = |name: &str| {
            let directory = runs.path().join(name);
            fs::create_dir(&directory).unwrap();
            fs::write(directory.join(common::run::FILE_NAME), "").unwrap();
            directory
        };
        fs::write(begun("ended").join(SUMMARY), "").unwrap();
        assert_eq!(cut_off(runs.path()).unwrap(), None);
        let cut = fs::canonicalize(begun("cut")).unwrap();
        assert_eq!(cut_off(runs.path()).unwrap(), Some(cut.clone()));
        mark_cut_off(&cut).unwrap();
        assert_eq!(cut_off(runs.path()).unwrap(), None, "reported again");
    }
}
