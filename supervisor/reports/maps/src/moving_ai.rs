//! Grids of the MovingAI benchmarks: N. R. Sturtevant, "Benchmarks for Grid-Based Pathfinding"
//! (2012).
//!
//! A header of four lines, `type`, `height`, `width` and `map`, precedes one character per cell.

use std::path::Path;

use harmonic::MAX_SIDE;

use crate::{
    error::MapError,
    file::{check_size, read},
    map::Map,
};

/// Bytes of the largest map, with two characters at each line end, and its header.
const LONGEST: u64 = MAX_SIDE as u64 * (MAX_SIDE as u64 + 2) + 4096;

pub(super) fn load(file: &Path) -> Result<Map, MapError> {
    parse(&read(file, LONGEST)?).map_err(|problem| MapError::of(file, problem))
}

fn parse(bytes: &[u8]) -> Result<Map, String> {
    let mut lines =
        bytes.split(|&byte| byte == b'\n').map(|line| line.strip_suffix(b"\r").unwrap_or(line));
    let (cols, rows) = header(&mut lines)?;
    check_size(cols, rows)?;
    let (cols, rows) = (cols as usize, rows as usize);
    let mut free = Vec::with_capacity(cols.saturating_mul(rows).min(bytes.len()));
    for row in 0..rows {
        let line = lines.next().unwrap_or_default();
        if line.len() != cols {
            return Err(format!(
                "row {row} has {} cells, but the header states {cols} and {rows} rows; complete the file or correct its header",
                line.len()
            ));
        }
        for (col, &cell) in line.iter().enumerate() {
            free.push(is_free(cell).ok_or_else(|| {
                format!(
                    "'{}' in row {row}, column {col} is not a cell; use . G S (free) and @ O T W (blocked)",
                    cell.escape_ascii()
                )
            })?);
        }
    }
    if lines.any(|line| !line.trim_ascii().is_empty()) {
        return Err(format!("more than the {rows} rows of its header; correct `height`"));
    }
    Ok(Map::new(cols, free).with_rim())
}

fn header<'a>(lines: &mut impl Iterator<Item = &'a [u8]>) -> Result<(u64, u64), &'static str> {
    let (mut cols, mut rows, mut begun) = (None, None, false);
    // `type` is the kind of motion between cells, and unused.
    for line in lines.take(4) {
        let text = String::from_utf8_lossy(line);
        let mut words = text.split_whitespace();
        let (key, value) = (words.next(), words.next());
        let number = || value.and_then(|value| value.parse().ok());
        match key {
            Some("type") => {}
            Some("height") => rows = number(),
            Some("width") => cols = number(),
            key => {
                begun = key == Some("map");
                break;
            }
        }
    }
    match (cols, rows) {
        (Some(cols), Some(rows)) if begun => Ok((cols, rows)),
        _ => Err(
            "not a MovingAI map: it begins with the lines `type octile`, `height H`, `width W`, `map`",
        ),
    }
}

/// Returns true for ground and swamp, false for out of bounds, trees and water, `None` for other
/// characters.
fn is_free(cell: u8) -> Option<bool> {
    match cell {
        b'.' | b'G' | b'S' => Some(true),
        b'@' | b'O' | b'T' | b'W' => Some(false),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ground_and_swamp_are_free_and_nothing_else_whatever_the_line_ends() {
        let text = "type octile\nheight 3\nwidth 9\nmap\n@@@@@@@@@\n@.GS@OTW@\n@@@@@@@@@\n";
        for text in [text.to_owned(), text.replace('\n', "\r\n")] {
            let map = parse(text.as_bytes()).unwrap();
            let free: Vec<usize> = (0..27).filter(|&at| !map.blocked[at]).collect();
            assert_eq!((map.cols, map.rows, free), (9, 3, vec![10, 11, 12]));
        }
    }

    #[test]
    fn a_map_that_is_not_as_its_header_says_is_refused_with_the_place() {
        let cases = [
            ("", "begins with"),
            ("height 1\nwidth 3\n...\n", "begins with"),
            ("type octile\nheight x\nwidth 3\nmap\n...\n", "begins with"),
            ("type octile\nheight 2\nwidth 3\nmap\n...\n", "row 1 has 0"),
            ("type octile\nheight 1\nwidth 3\nmap\n....\n", "row 0 has 4"),
            ("type octile\nheight 1\nwidth 3\nmap\n...\n...\n", "more than"),
            ("type octile\nheight 1\nwidth 3\nmap\n.\u{7}.\n", "column 1"),
            ("type octile\nheight 0\nwidth 3\nmap\n", "0 cells"),
            ("type octile\nheight 99999999999\nwidth 3\nmap\n", "99999999999"),
        ];
        for (text, said) in cases {
            let error = parse(text.as_bytes()).unwrap_err();
            assert!(error.contains(said), "{text:?} gave {error}");
        }
    }
}
