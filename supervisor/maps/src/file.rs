//! Map files with limits of length and of cells.

use std::{
    fs::{self, File},
    io::Read as _,
    path::Path,
};

use harmonic::MAX_SIDE;

use crate::error::MapError;

/// Files that are not regular may never end.
pub(crate) fn open(file: &Path, most: u64) -> Result<File, MapError> {
    let unreadable = |cause| MapError::Unreadable { file: file.to_owned(), cause };
    // The check comes before opening, because opening a pipe waits for its other end.
    let metadata = fs::metadata(file).map_err(unreadable)?;
    if !metadata.is_file() {
        return Err(MapError::NotAFile { file: file.to_owned() });
    }
    if metadata.len() > most {
        return Err(MapError::TooLong { file: file.to_owned(), bytes: metadata.len(), most });
    }
    File::open(file).map_err(unreadable)
}

pub(crate) fn read(file: &Path, most: u64) -> Result<Vec<u8>, MapError> {
    let mut bytes = Vec::new();
    open(file, most)?
        .take(most)
        .read_to_end(&mut bytes)
        .map_err(|cause| MapError::Unreadable { file: file.to_owned(), cause })?;
    Ok(bytes)
}

/// An empty map is refused, too.
pub(crate) fn check_size(file: &Path, cols: u64, rows: u64) -> Result<(), MapError> {
    let sides = 1..=MAX_SIDE as u64;
    if sides.contains(&cols) && sides.contains(&rows) {
        return Ok(());
    }
    Err(MapError::Size { file: file.to_owned(), cols, rows })
}
