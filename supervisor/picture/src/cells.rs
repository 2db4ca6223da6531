//! Hazard cells of the map at the end, by their source.

use common::grid::CellState;
use glam::DVec2;

use super::{
    lattice::Lattice,
    page::{Path, ink},
};

/// Bytes of this layer: an irregular belief is drawn coarser, not larger.
const BUDGET: usize = 90_000;

pub(super) struct BelievedHazard {
    sensed: Path,
    known: Path,
    perimeter: Path,
}

impl BelievedHazard {
    /// `cells` has one byte a cell, row-major.
    pub(super) fn of(lattice: &Lattice, cells: &[u8]) -> Self {
        let mut block = 1;
        loop {
            let hazard = Self::in_blocks(lattice, cells, block);
            if hazard.len() <= BUDGET || block >= lattice.longest() {
                return hazard;
            }
            block *= 2;
        }
    }

    fn in_blocks(lattice: &Lattice, cells: &[u8], block: usize) -> Self {
        let blocks = Blocks { lattice, side: block, kinds: coarsened(lattice, cells, block) };
        Self {
            sensed: blocks.area(CellState::Sensed),
            known: blocks.area(CellState::Known),
            perimeter: blocks.area(CellState::Perimeter),
        }
    }

    fn len(&self) -> usize {
        self.sensed.len() + self.known.len() + self.perimeter.len()
    }

    pub(super) const fn has_sensed(&self) -> bool {
        !self.sensed.is_empty()
    }

    pub(super) const fn has_known(&self) -> bool {
        !self.known.is_empty()
    }

    pub(super) const fn has_perimeter(&self) -> bool {
        !self.perimeter.is_empty()
    }

    pub(super) fn layer(&self) -> String {
        [(&self.perimeter, ink::PERIMETER), (&self.known, ink::KNOWN), (&self.sensed, ink::SENSED)]
            .map(|(area, colour)| area.element(&format!("fill=\"{colour}\"")))
            .concat()
    }
}

pub(super) struct Blocks<'a, Kind> {
    pub(super) lattice: &'a Lattice,
    pub(super) side: usize,
    /// Row-major.
    pub(super) kinds: Vec<Kind>,
}

/// A block is hazard if any of its cells is, of the most frequent kind of hazard.
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
    let kinds = [CellState::Sensed, CellState::Known, CellState::Perimeter];
    tally
        .iter()
        .map(|count| {
            kinds
                .into_iter()
                .filter(|kind| count[*kind as usize] > 0)
                .max_by_key(|kind| count[*kind as usize])
                .unwrap_or(CellState::Free)
        })
        .collect()
}

impl<Kind: Copy + PartialEq> Blocks<'_, Kind> {
    /// Runs along x are joined along y where they are equal.
    pub(super) fn area(&self, kind: Kind) -> Path {
        let across = self.lattice.cols.div_ceil(self.side);
        let mut path = Path::default();
        let mut open: Vec<Run> = Vec::new();
        for (row, line) in self.kinds.chunks(across.max(1)).enumerate() {
            let (grown, ended) = continued(open, runs(line, kind), row);
            for run in ended {
                self.draw(&mut path, run, row);
            }
            open = grown;
        }
        for run in open {
            self.draw(&mut path, run, self.lattice.rows.div_ceil(self.side));
        }
        path
    }

    fn draw(&self, path: &mut Path, run: Run, end_row: usize) {
        // The last block of a row or column may be cut short by the map's edge.
        let edge = |block: usize, cells: usize| (block * self.side).min(cells) as f64 - 0.5;
        let corner = |col: usize, row: usize| {
            let (col, row) = (edge(col, self.lattice.cols), edge(row, self.lattice.rows));
            self.lattice.place(DVec2::new(col, row))
        };
        let (one, other) = (corner(run.from, run.since), corner(run.until, end_row));
        // The first row may lie at the top of the sheet or at its bottom.
        let low = one.min(other);
        path.rectangle(low, one.max(other) - low);
    }
}

/// Blocks `from..until` of one kind, equal in every row from `since` on.
#[derive(Clone, Copy)]
struct Run {
    from: usize,
    until: usize,
    since: usize,
}

/// Each run is (from, until).
fn runs<Kind: Copy + PartialEq>(line: &[Kind], kind: Kind) -> Vec<(usize, usize)> {
    let mut found: Vec<(usize, usize)> = Vec::new();
    for (col, &found_kind) in line.iter().enumerate() {
        if found_kind != kind {
            continue;
        }
        match found.last_mut() {
            Some((_, until)) if *until == col => *until += 1,
            _ => found.push((col, col + 1)),
        }
    }
    found
}

/// Runs that are open after `row`, and those that ended before it.
fn continued(open: Vec<Run>, row_runs: Vec<(usize, usize)>, row: usize) -> (Vec<Run>, Vec<Run>) {
    let grown: Vec<Run> = row_runs
        .into_iter()
        .map(|(from, until)| Run {
            from,
            until,
            since: open
                .binary_search_by_key(&from, |run| run.from)
                .ok()
                .filter(|&at| open[at].until == until)
                .map_or(row, |at| open[at].since),
        })
        .collect();
    let ended = open
        .into_iter()
        .filter(|run| {
            let goes_on = grown
                .binary_search_by_key(&run.from, |next| next.from)
                .is_ok_and(|at| grown[at].until == run.until);
            !goes_on
        })
        .collect();
    (grown, ended)
}

#[cfg(test)]
mod tests {
    use common::grid::GridFrame;

    use super::{super::page::View, *};

    fn lattice(cells: u32) -> Lattice {
        let frame = GridFrame { cells, resolution_m: 8.0 / f64::from(cells), centre: DVec2::ZERO };
        Lattice::of_mission(&frame, &View::of(&frame))
    }

    #[test]
    fn alike_runs_become_one_rectangle_where_the_cells_lie() {
        let lattice = lattice(8);
        let mut cells = [0_u8; 64];
        for at in [2 * 8 + 1, 2 * 8 + 2, 3 * 8 + 1, 3 * 8 + 2, 4 * 8 + 1] {
            cells[at] = 1;
        }
        let hazard = BelievedHazard::of(&lattice, &cells);
        let two = "M162 492h200v200h-200z";
        let one = "M162 392h100v100h-100z";
        assert!(hazard.sensed.element("").contains(&format!("{two}{one}")));
        assert!(!hazard.has_known() && !hazard.has_perimeter());
    }

    #[test]
    fn a_belief_in_shreds_stays_within_its_budget() {
        let lattice = lattice(1024);
        let cells: Vec<u8> =
            (0..1024 * 1024).map(|at| ((at / 1024 + at % 1024) % 2) as u8).collect();
        let hazard = BelievedHazard::of(&lattice, &cells);
        assert!(hazard.has_sensed() && hazard.len() <= BUDGET);
    }
}
