#![allow(clippy::unwrap_used)]

use std::path::Path;

use common::{
    grid::{CellState, GridFrame, Part},
    mission::Mission,
    samples::{GridHeader, PoseSample, TargetSample},
};
use glam::DVec2;

use super::planner::Baseline;

/// Returns the header and cells of a drawn map: `#` is hazard, the first row has the greatest y.
/// Cells are 0.1 m wide, the middle one at (0, 0).
pub fn drawn(rows: &[&str]) -> (GridHeader, Vec<u8>) {
    let frame = GridFrame { cells: rows.len() as u32, resolution_m: 0.1, centre: DVec2::ZERO };
    let letters = rows.iter().rev().flat_map(|row| row.bytes());
    let state = |letter| match letter {
        b'#' => CellState::Sensed as u8,
        _ => CellState::Free as u8,
    };
    let header = GridHeader { part: Part::whole(frame, 1), ..GridHeader::default() };
    (header, letters.map(state).collect())
}

pub fn sent(target: [f64; 2]) -> Baseline {
    let text = format!("target = {target:?}");
    let mission = Mission::parse(&text, Path::new("test.toml")).unwrap();
    let mut baseline = Baseline::new(&mission);
    baseline.target = Some(TargetSample::first(&mission));
    baseline
}

pub fn pose([x_m, y_m]: [f64; 2]) -> PoseSample {
    PoseSample { x_m, y_m, ..PoseSample::default() }
}
