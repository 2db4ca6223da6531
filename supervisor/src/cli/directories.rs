//! Where a run's files go: a directory of its own.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use super::Failure;

/// In a run directory whose run ended in order.
pub(super) const SUMMARY: &str = "summary.json";
/// In a run directory whose run was cut off, once somebody was told.
const CUT_OFF: &str = "cut-off";

/// The directory asked for; results of an earlier run are not mixed with this one's.
pub(super) fn own(directory: &Path) -> Result<PathBuf, Failure> {
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
pub(super) fn numbered(runs: &Path, name: &str) -> Result<PathBuf, Failure> {
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

/// A run below `runs` that was begun and never summed up: its supervisor was killed, or the machine. It is told
/// once, and noted there: who then starts anew means it.
pub(super) fn cut_off(runs: &Path) -> io::Result<Option<PathBuf>> {
    let entries = match fs::read_dir(runs) {
        Ok(entries) => entries,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error),
    };
    let mut found = None;
    for entry in entries {
        let directory = entry?.path();
        let has = |name: &str| directory.join(name).exists();
        if has(common::run::FILE_NAME) && !has(SUMMARY) && !has(CUT_OFF) {
            fs::write(directory.join(CUT_OFF), "")?;
            found = Some(directory);
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_that_was_cut_off_is_told_once() {
        let runs = tempfile::tempdir().unwrap();
        let begun = |name: &str| {
            let directory = runs.path().join(name);
            fs::create_dir(&directory).unwrap();
            fs::write(directory.join(common::run::FILE_NAME), "").unwrap();
            directory
        };
        fs::write(begun("ended").join(SUMMARY), "").unwrap();
        assert_eq!(cut_off(runs.path()).unwrap(), None);
        let cut = begun("cut");
        assert_eq!(cut_off(runs.path()).unwrap(), Some(cut));
        assert_eq!(cut_off(runs.path()).unwrap(), None, "told again");
    }
}
