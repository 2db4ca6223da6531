//! Map files, with limits of length and of cells.

use std::{
    fs::{self, File},
    io::Read as _,
    path::Path,
};

use harmonic::MAX_SIDE;

use crate::error::MapError;

/// Refuses special files, which may never end.
pub(crate) fn open(file: &Path, most: u64) -> Result<File, MapError> {
    // Checked before opening, because opening a pipe waits for its other end.
    let metadata = fs::metadata(file).map_err(MapError::unreadable(file))?;
    if !metadata.is_file() {
        // Directory, pipe or device.
        return Err(MapError::of(file, "not a regular file; give a map file"));
    }
    let bytes = metadata.len();
    if bytes > most {
        let problem =
            format!("{bytes} bytes, but a file of this kind has at most {most}; check its type");
        return Err(MapError::of(file, problem));
    }
    File::open(file).map_err(MapError::unreadable(file))
}

pub(crate) fn read(file: &Path, most: u64) -> Result<Vec<u8>, MapError> {
    let mut bytes = Vec::new();
    open(file, most)?.take(most).read_to_end(&mut bytes).map_err(MapError::unreadable(file))?;
    Ok(bytes)
}

/// Refuses empty maps, too.
pub(crate) fn check_size(cols: u64, rows: u64) -> Result<(), String> {
    let sides = 1..=MAX_SIDE as u64;
    if sides.contains(&cols) && sides.contains(&rows) {
        return Ok(());
    }
    Err(format!(
        "{cols} x {rows} cells; a map has 1 to {MAX_SIDE} on each side, so crop or scale it"
    ))
}
