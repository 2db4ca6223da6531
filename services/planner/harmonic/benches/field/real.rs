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
    let (width, height, grey) = pgm(&std::fs::read(file).expect("a map"));
    let mut blocked: Vec<bool> = grey.iter().map(|&grey| grey < FREE_FROM).collect();
    for (at, blocked) in blocked.iter_mut().enumerate() {
        let (col, row) = (at % width, at / width);
        *blocked |= col == 0 || row == 0 || col == width - 1 || row == height - 1;
    }
    let from_middle = |at: &usize| {
        let (col, row) = (at % width, at / width);
        col.abs_diff(width / 2).pow(2) + row.abs_diff(height / 2).pow(2)
    };
    let target =
        (0..blocked.len()).filter(|&at| !blocked[at]).min_by_key(from_middle).expect("a free cell");
    let target = Cell::new(target % width, target / width);
    Domain::new(width, height, blocked, target).expect("a valid map")
}

/// Columns, rows and pixels of a binary PGM of 8 bits, whose comments are lines of their own.
fn pgm(bytes: &[u8]) -> (usize, usize, Vec<u8>) {
    let mut numbers = Vec::new();
    let mut rest = bytes.strip_prefix(b"P5\n").expect("a binary PGM");
    while numbers.len() < 3 {
        let end = rest.iter().position(|&byte| byte == b'\n');
        let (line, after) = rest.split_at(end.expect("a header") + 1);
        rest = after;
        let line = std::str::from_utf8(line).expect("a header in ASCII");
        if !line.starts_with('#') {
            let words = line.split_whitespace();
            numbers.extend(words.map(|word| word.parse::<usize>().expect("a number")));
        }
    }
    assert_eq!(numbers[2], 255, "8 bits");
    (numbers[0], numbers[1], rest.to_vec())
}
