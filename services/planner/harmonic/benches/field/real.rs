//! Maps of real places, one cell per pixel.

use std::{
    io::BufRead as _,
    path::{Path, PathBuf},
};

use harmonic::{Cell, Domain};

use crate::support::Map;

/// Threshold of the ROS map_server; darker cells are not free.
const FREE_FROM: u8 = 206;

pub(crate) fn load_all(directory: String) -> Vec<(String, Domain)> {
    let entries = std::fs::read_dir(directory).expect("a directory of maps");
    let mut files: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "pgm"));
    files.sort();
    let name = |file: &PathBuf| file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    files.iter().map(|file| (name(file), load(file))).collect()
}

/// Loads a map; the target is the free cell nearest to the middle.
fn load(file: &Path) -> Domain {
    let bytes = std::fs::read(file).expect("a map");
    let mut map = pgm(&bytes);
    map.block_rim();
    map.aim((map.width / 2, map.height / 2));
    map.domain()
}

/// Reads a binary 8-bit PGM with comments on separate lines.
fn pgm(bytes: &[u8]) -> Map {
    let mut numbers = Vec::new();
    let mut rest = bytes.strip_prefix(b"P5\n").expect("a binary PGM");
    while numbers.len() < 3 {
        let mut line = String::new();
        assert_ne!(rest.read_line(&mut line).expect("a header in ASCII"), 0, "a header");
        if !line.starts_with('#') {
            let words = line.split_whitespace();
            numbers.extend(words.map(|word| word.parse::<usize>().expect("a number")));
        }
    }
    assert_eq!(numbers[2], 255, "8 bits");
    let (width, height) = (numbers[0], numbers[1]);
    let blocked = rest[..width * height].iter().map(|&grey| grey < FREE_FROM).collect();
    Map { width, height, blocked, target: Cell::new(0, 0) }
}
