//! Hazard cells of the final map, by their source.

use std::collections::BTreeMap;

use common::grid::CellState;
use glam::DVec2;

use super::{
    lattice::Lattice,
    page::{Path, ink},
};

/// Size limit of this layer, bytes; an irregular belief gets coarser.
const BUDGET: usize = 90_000;

/// Areas with colours and legend names, lowest first.
pub(super) struct BelievedHazard(pub(super) [(&'static str, &'static str, Path); 3]);

impl BelievedHazard {
    pub(super) fn of(lattice: &Lattice, cells: &[u8]) -> Self {
        let mut block = 1;
        loop {
            let kinds = coarsened(lattice, cells, block);
            let blocks = Blocks { lattice, side: block, kinds };
            let hazard = Self([
                (ink::PERIMETER, "perimeter", blocks.area(CellState::Perimeter)),
                (ink::KNOWN, "known beforehand", blocks.area(CellState::Known)),
                (ink::SENSED, "sensed, with margin", blocks.area(CellState::Sensed)),
            ]);
            let length: usize = hazard.0.iter().map(|(.., area)| area.len()).sum();
            if length <= BUDGET || block >= lattice.longest() {
                return hazard;
            }
            block *= 2;
        }
    }

    pub(super) fn layer(&self) -> String {
        self.0.iter().map(|(colour, _, area)| area.element(&format!("fill=\"{colour}\""))).collect()
    }
}

pub(super) struct Blocks<'a, Kind> {
    pub lattice: &'a Lattice,
    pub side: usize,
    pub kinds: Vec<Kind>,
}

/// Coarsens to blocks. A block with hazard cells gets their most frequent kind.
fn coarsened(lattice: &Lattice, cells: &[u8], block: usize) -> Vec<CellState> {
    let across = lattice.cols.div_ceil(block);
    let mut tally = vec![[0_u32; 6]; across * lattice.rows.div_ceil(block)];
    for (row, line) in cells.chunks(lattice.cols.max(1)).enumerate() {
        for (col, &byte) in line.iter().enumerate() {
            let at = row / block * across + col / block;
            let kind = match CellState::from_byte(byte) {
                CellState::Margin => CellState::Sensed,
                kind => kind,
            };
            tally[at][kind as usize] += 1;
        }
    }
    let most = |count: &[u32; 6]| {
        [CellState::Sensed, CellState::Known, CellState::Perimeter]
            .into_iter()
            .filter(|kind| count[*kind as usize] > 0)
            .max_by_key(|kind| count[*kind as usize])
            .unwrap_or(CellState::Free)
    };
    tally.iter().map(most).collect()
}

impl<Kind: Copy + PartialEq> Blocks<'_, Kind> {
    /// Joins equal runs of neighbouring rows.
    pub(super) fn area(&self, kind: Kind) -> Path {
        let across = self.lattice.cols.div_ceil(self.side).max(1);
        assert!(self.kinds.len().is_multiple_of(across));
        let mut path = Path::default();
        // First row of each unfinished run.
        let mut open = BTreeMap::new();
        for (row, line) in self.kinds.chunks(across).enumerate() {
            let mut goes_on = BTreeMap::new();
            let mut at = 0;
            for run in line.chunk_by(|one, other| one == other) {
                let cols = (at, at + run.len());
                at = cols.1;
                if run[0] == kind {
                    goes_on.insert(cols, open.remove(&cols).unwrap_or(row));
                }
            }
            self.draw(&mut path, std::mem::replace(&mut open, goes_on), row);
        }
        self.draw(&mut path, open, self.kinds.len().div_ceil(across));
        path
    }

    fn draw(&self, path: &mut Path, runs: BTreeMap<(usize, usize), usize>, end_row: usize) {
        let edge = |block: usize, cells: usize| (block * self.side).min(cells) as f64 - 0.5;
        let corner = |col: usize, row: usize| {
            let (col, row) = (edge(col, self.lattice.cols), edge(row, self.lattice.rows));
            self.lattice.place(DVec2::new(col, row))
        };
        for ((from, until), since) in runs {
            let (one, other) = (corner(from, since), corner(until, end_row));
            // The first row may lie at the top or the bottom.
            let low = one.min(other);
            path.rectangle(low, one.max(other) - low);
        }
    }
}

#[cfg(test)]
mod tests {
    use common::grid::GridFrame;

    use super::{super::page::View, *};

    #[test]
    fn alike_runs_become_one_rectangle_where_the_cells_lie() {
        let frame = GridFrame { cells: 8, resolution_m: 1.0, centre: DVec2::ZERO };
        let lattice = Lattice::of_mission(&frame, &View::of(&frame));
        let mut cells = [0_u8; 64];
        for at in [2 * 8 + 1, 2 * 8 + 2, 3 * 8 + 1, 3 * 8 + 2, 4 * 8 + 1] {
            cells[at] = 1;
        }
        let hazard = BelievedHazard::of(&lattice, &cells);
        let two = "M162 492h200v200h-200z";
        let one = "M162 392h100v100h-100z";
        let [perimeter, known, sensed] = hazard.0.each_ref().map(|(.., area)| area);
        assert!(sensed.element("").contains(&format!("{two}{one}")));
        assert!(known.is_empty() && perimeter.is_empty());
    }
}
