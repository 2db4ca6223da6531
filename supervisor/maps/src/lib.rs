//! Maps as others keep them: which cells a robot can be in.
//!
//! | module | reads |
//! |---|---|
//! | [`ros`] | a ROS map_server YAML and the image it names |
//! | [`image`] | a PGM (any Netpbm) or PNG image |
//! | [`moving_ai`] | the `.map` grids of the MovingAI benchmarks |
//!
//! Files come from anywhere: sizes are checked before memory is taken, and everything that cannot be read is refused
//! with the file, the cause and the remedy.

mod image;
mod moving_ai;
mod ros;

use std::{
    fs::{self, File},
    io,
    path::{Path, PathBuf},
};

use harmonic::MAX_SIDE;
use thiserror::Error;

/// A map of cells, row-major, row 0 at the top.
#[derive(Debug)]
pub struct Map {
    /// Columns.
    pub cols: usize,
    /// Rows.
    pub rows: usize,
    /// Everything that is not free, and the whole rim.
    pub blocked: Vec<bool>,
}

impl Map {
    /// A map of `free` cells. Its rim counts as blocked, as the perimeter of a mission does.
    fn new(cols: usize, rows: usize, free: impl Iterator<Item = bool>) -> Self {
        let mut blocked: Vec<bool> = free.map(|free| !free).collect();
        for (row, line) in blocked.chunks_mut(cols.max(1)).enumerate() {
            if row == 0 || row + 1 == rows {
                line.fill(true);
            }
            for rim in [0, cols.saturating_sub(1)] {
                if let Some(cell) = line.get_mut(rim) {
                    *cell = true;
                }
            }
        }
        Self {
            cols,
            rows,
            blocked,
        }
    }

    /// The free cell nearest to (`col`, `row`), as column and row; none if no cell is free.
    pub fn nearest_free(&self, col: usize, row: usize) -> Option<(usize, usize)> {
        let free = self.blocked.iter().enumerate().filter(|cell| !cell.1);
        free.map(|(at, _)| (at % self.cols, at / self.cols))
            .min_by_key(|cell| {
                let (x, y) = (cell.0.abs_diff(col) as u64, cell.1.abs_diff(row) as u64);
                // Far outside the map a distance may not fit.
                x.saturating_mul(x).saturating_add(y.saturating_mul(y))
            })
    }
}

/// A map that cannot be had. Every sentence begins with the file.
#[derive(Debug, Error)]
pub enum MapError {
    /// The file cannot be opened or read.
    #[error("{}: {cause}; give a map file that can be read", file.display())]
    Unreadable {
        /// The map or its image.
        file: PathBuf,
        /// What the system said.
        cause: io::Error,
    },
    /// A directory, a pipe, a device.
    #[error("{}: not a regular file; give a map file", file.display())]
    NotAFile {
        /// What was given.
        file: PathBuf,
    },
    /// Nothing in the name tells what it is.
    #[error(
        "{}: not the name of a map; give a .yaml of the ROS map_server, a .pgm or .png image, or a MovingAI .map",
        file.display()
    )]
    UnknownFormat {
        /// What was given.
        file: PathBuf,
    },
    /// The format says more than any map of that kind needs.
    #[error("{}: {bytes} bytes, a file of this kind has at most {most}; check that it is one", file.display())]
    TooLong {
        /// The file.
        file: PathBuf,
        /// Its length.
        bytes: u64,
        /// What is read.
        most: u64,
    },
    /// No cells, or more than the planner takes.
    #[error("{}: {cols} x {rows} cells; a map has 1 to {MAX_SIDE} on each side, so crop or scale it", file.display())]
    Size {
        /// The map or its image.
        file: PathBuf,
        /// Columns.
        cols: u64,
        /// Rows.
        rows: u64,
    },
    /// Not what its format asks for.
    #[error("{}: {problem}", file.display())]
    Malformed {
        /// The map or its image.
        file: PathBuf,
        /// What is wrong, where, and what to do.
        problem: String,
    },
}

impl MapError {
    fn malformed(file: &Path, problem: impl Into<String>) -> Self {
        Self::Malformed {
            file: file.to_owned(),
            problem: problem.into(),
        }
    }
}

/// The map in `file`, whose name says how to read it.
pub fn load(file: &Path) -> Result<Map, MapError> {
    let extension = file
        .extension()
        .map(|extension| extension.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("yaml" | "yml") => ros::load(file),
        Some("pgm" | "png" | "pbm" | "ppm" | "pnm") => {
            image::load(file, image::Lightness::default())
        }
        Some("map") => moving_ai::load(file),
        _ => Err(MapError::UnknownFormat {
            file: file.to_owned(),
        }),
    }
}

/// A regular file of at most `most` bytes, opened. Anything else might never end.
fn open(file: &Path, most: u64) -> Result<File, MapError> {
    let unreadable = |cause| MapError::Unreadable {
        file: file.to_owned(),
        cause,
    };
    // Before opening: to open a pipe is to wait for its other end.
    let metadata = fs::metadata(file).map_err(unreadable)?;
    if !metadata.is_file() {
        return Err(MapError::NotAFile {
            file: file.to_owned(),
        });
    }
    if metadata.len() > most {
        return Err(MapError::TooLong {
            file: file.to_owned(),
            bytes: metadata.len(),
            most,
        });
    }
    File::open(file).map_err(unreadable)
}

/// All of a file of at most `most` bytes.
fn read(file: &Path, most: u64) -> Result<Vec<u8>, MapError> {
    use io::Read as _;
    let mut bytes = Vec::new();
    open(file, most)?
        .take(most)
        .read_to_end(&mut bytes)
        .map_err(|cause| MapError::Unreadable {
            file: file.to_owned(),
            cause,
        })?;
    Ok(bytes)
}

/// Refuses a size no map has.
fn check_size(file: &Path, cols: u64, rows: u64) -> Result<(), MapError> {
    let sides = 1..=MAX_SIDE as u64;
    if sides.contains(&cols) && sides.contains(&rows) {
        return Ok(());
    }
    Err(MapError::Size {
        file: file.to_owned(),
        cols,
        rows,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rim_of_a_map_is_blocked_and_nothing_else() {
        let map = Map::new(4, 3, [true; 12].into_iter());
        let free: Vec<usize> = (0..12).filter(|&at| !map.blocked[at]).collect();
        assert_eq!(free, [5, 6]);
        let map = Map::new(1, 1, [true].into_iter());
        assert_eq!(map.blocked, [true]);
    }

    #[test]
    fn the_nearest_free_cell_is_found_from_outside_too() {
        let map = Map::new(5, 5, [true; 25].into_iter());
        assert_eq!(map.nearest_free(0, 2), Some((1, 2)));
        assert_eq!(map.nearest_free(usize::MAX, 3), Some((1, 1)));
        let walled = Map::new(2, 2, [true; 4].into_iter());
        assert_eq!(walled.nearest_free(0, 0), None);
    }

    #[test]
    fn what_is_no_file_of_a_known_kind_is_refused() {
        let directory = tempfile::tempdir().unwrap();
        let folder = directory.path().join("folder.map");
        fs::create_dir(&folder).unwrap();
        assert!(matches!(load(&folder), Err(MapError::NotAFile { .. })));
        let missing = directory.path().join("missing.png");
        assert!(matches!(load(&missing), Err(MapError::Unreadable { .. })));
        let nameless = directory.path().join("map");
        assert!(matches!(
            load(&nameless),
            Err(MapError::UnknownFormat { .. })
        ));
    }
}
