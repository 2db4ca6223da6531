//! Maps and fields as binary messages of the page.
//!
//! | bytes | content, little-endian |
//! |---|---|
//! | 0 | 1: a map, 2: a field, 3: the field of a previewed target |
//! | 2..4 | N: N x N cells |
//! | 4..8 | side of a cell, metres, f32 |
//! | 8..16 | lower left corner, metres, two f32 |
//! | 16..24 | mission time, seconds, f64 |
//! | 24..32 | target of a field, metres, two f32 |
//! | 32.. | cells, row-major from below, as raw deflate |
//!
//! A map cell is its [`common::grid::CellState`] byte. A field has a plane of directions: 254 steps
//! of a turn from x, counter-clockwise, and 255 for none. A plane of -2 log2 u follows, with 255
//! for u = 0.

use std::io::Write as _;

use common::{
    grid::{GridFrame, MAX_CELLS},
    samples::FieldCell,
};
use flate2::{Compression, write::DeflateEncoder};
use glam::DVec2;

const STEPS: f32 = 254.0;
const NONE: u8 = 255;
/// Most cells on a side of a field. Larger ones are subsampled.
const MOST_A_SIDE: usize = 256;

#[derive(Clone, Copy, Debug)]
pub enum Shown {
    Map = 1,
    Field = 2,
    Preview = 3,
}

pub fn map(frame: GridFrame, cells: &[u8], time_s: f64) -> Vec<u8> {
    message(Shown::Map, (frame, 1), DVec2::ZERO, time_s, cells)
}

pub fn field(
    shown: Shown,
    frame: GridFrame,
    cells: &[FieldCell],
    target: DVec2,
    time_s: f64,
) -> Vec<u8> {
    let side = frame.cells as usize;
    let every = side.div_ceil(MOST_A_SIDE).max(1);
    let sent = side / every;
    let (mut directions, mut depths) = (Vec::new(), Vec::new());
    for row in 0..sent {
        for col in 0..sent {
            let cell = cells[(row * every + every / 2) * side + col * every + every / 2];
            directions.push(direction(cell));
            depths.push(depth(cell));
        }
    }
    directions.append(&mut depths);
    assert!(sent <= MOST_A_SIDE && directions.len() == 2 * sent * sent);
    message(shown, (frame, every as u32), target, time_s, &directions)
}

fn direction(cell: FieldCell) -> u8 {
    if cell.ex == 0.0 && cell.ey == 0.0 {
        return NONE;
    }
    let turns = cell.ey.atan2(cell.ex) / std::f32::consts::TAU;
    (turns.rem_euclid(1.0) * STEPS).round() as u8 % STEPS as u8
}

fn depth(cell: FieldCell) -> u8 {
    let depth = -2.0 * cell.log2_u;
    if depth.is_finite() { depth.round().clamp(0.0, 254.0) as u8 } else { NONE }
}

/// Makes a message of `cells`, which stand for `every` by `every` cells of `frame` each.
fn message(
    shown: Shown,
    (frame, every): (GridFrame, u32),
    target: DVec2,
    time_s: f64,
    cells: &[u8],
) -> Vec<u8> {
    const { assert!(MAX_CELLS <= u16::MAX as u32) };
    let corner = frame.corner();
    let mut message = vec![shown as u8, 0];
    message.extend(((frame.cells / every) as u16).to_le_bytes());
    for value in [frame.resolution_m * f64::from(every), corner.x, corner.y] {
        message.extend((value as f32).to_le_bytes());
    }
    message.extend(time_s.to_le_bytes());
    for value in [target.x, target.y] {
        message.extend((value as f32).to_le_bytes());
    }
    let mut deflated = DeflateEncoder::new(message, Compression::fast());
    let _ = deflated.write_all(cells);
    deflated.finish().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read as _;

    fn frame(cells: u32) -> GridFrame {
        GridFrame { cells, resolution_m: 0.1, centre: DVec2::new(1.0, 0.0) }
    }

    fn unpacked(message: &[u8]) -> Vec<u8> {
        let mut cells = Vec::new();
        flate2::read::DeflateDecoder::new(&message[32..]).read_to_end(&mut cells).unwrap();
        cells
    }

    #[test]
    fn a_map_is_unpacked_as_it_was_and_lies_where_it_is() {
        let cells: Vec<u8> = (0..100).map(|at| at % 6).collect();
        let message = map(frame(10), &cells, 7.5);
        assert_eq!((message[0], &message[2..4]), (1, &[10, 0][..]));
        let corner = f32::from_le_bytes(message[8..12].try_into().unwrap());
        assert!((corner - 0.45).abs() < 1e-6, "{corner}");
        assert_eq!(message[16..24], 7.5_f64.to_le_bytes());
        assert_eq!(unpacked(&message), cells);
    }

    #[test]
    fn a_field_has_a_direction_and_a_depth_for_each_cell_and_no_more_cells_than_the_limit() {
        let up = FieldCell { ex: 0.0, ey: 1.0, log2_u: -3.0 };
        let mut cells = vec![up; 100];
        cells[0] = FieldCell { log2_u: f32::NEG_INFINITY, ..FieldCell::default() };
        cells[1] = FieldCell { ex: 1.0, ey: -1e-9, log2_u: -1e9 };
        let sent = unpacked(&field(Shown::Field, frame(10), &cells, DVec2::X, 0.0));
        assert_eq!((&sent[..3], &sent[100..103]), (&[NONE, 0, 64][..], &[NONE, 254, 6][..]));
        let large = field(Shown::Field, frame(600), &vec![up; 360_000], DVec2::X, 0.0);
        assert_eq!(large[2..4], [200, 0]);
        assert_eq!(unpacked(&large).len(), 2 * 200 * 200);
    }
}
