//! Maps of real places, a cell a pixel.

use std::path::{Path, PathBuf};

use harmonic::{Cell, Domain};

/// The ROS map_server's threshold: a darker cell is not free.
const FREE_FROM: u8 = 206;

/// The maps in the PGMs of a directory, by name.
pub(crate) fn load_all(directory: &Path) -> Vec<(String, Domain)> {
    let entries = std::fs::read_dir(directory).expect("a directory of maps");
    let mut files: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "pgm"));
    files.sort();
    let named = |file: &PathBuf| {
        let name = file.file_stem().unwrap_or_default().to_string_lossy();
        (name.into_owned(), load(file))
    };
    files.iter().map(named).collect()
}

/// The map in a PGM, its target the free cell nearest to the middle.
fn load(file: &Path) -> Domain {
    let grey = image::open(file).expect("a PGM").into_luma8();
    let (width, height) = (grey.width() as usize, grey.height() as usize);
    let mut blocked: Vec<bool> = grey.iter().map(|&grey| grey < FREE_FROM).collect();
    for (at, blocked) in blocked.iter_mut().enumerate() {
        let (col, row) = (at % width, at / width);
        *blocked |= col == 0 || row == 0 || col == width - 1 || row == height - 1;
    }
    let from_middle = |at: &usize| {
        let (col, row) = (at % width, at / width);
        col.abs_diff(width / 2).pow(2) + row.abs_diff(height / 2).pow(2)
    };
    let target = (0..blocked.len())
        .filter(|&at| !blocked[at])
        .min_by_key(from_middle)
        .expect("a free cell");
    let target = Cell::new(target % width, target / width);
    Domain::new(width, height, blocked, target).expect("a valid map")
}
