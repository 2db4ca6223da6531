//! What was believed hazardous at the end, by where the belief came from.

use common::grid::{CellState, GridFrame};
use glam::DVec2;

use super::page::{Path, View, ink, metres};

/// Bytes this layer may take: a belief in shreds is drawn coarser, not larger.
const BUDGET: usize = 90_000;

/// The hazard cells of a belief, as areas of the sheet.
pub(super) struct BelievedHazard {
    sensed: Path,
    known: Path,
    perimeter: Path,
}

impl BelievedHazard {
    /// The hazard in `cells`, one byte a cell of `frame`, row-major.
    pub(super) fn of(view: &View, frame: &GridFrame, cells: &[u8]) -> Self {
        let mut block = 1;
        loop {
            let hazard = Self::in_blocks(view, frame, cells, block);
            if hazard.len() <= BUDGET || block >= frame.cells {
                return hazard;
            }
            block *= 2;
        }
    }

    fn in_blocks(view: &View, frame: &GridFrame, cells: &[u8], block: u32) -> Self {
        let blocks = Blocks {
            frame,
            side: block,
            states: coarsened(frame, cells, block),
        };
        Self {
            sensed: blocks.area(view, CellState::Sensed),
            known: blocks.area(view, CellState::Known),
            perimeter: blocks.area(view, CellState::Perimeter),
        }
    }

    fn len(&self) -> usize {
        self.sensed.len() + self.known.len() + self.perimeter.len()
    }

    /// Whether a sensor marked anything.
    pub(super) const fn has_sensed(&self) -> bool {
        !self.sensed.is_empty()
    }

    /// Whether anything was known beforehand.
    pub(super) const fn has_known(&self) -> bool {
        !self.known.is_empty()
    }

    /// Whether the perimeter is marked.
    pub(super) const fn has_perimeter(&self) -> bool {
        !self.perimeter.is_empty()
    }

    /// The layer.
    pub(super) fn layer(&self) -> String {
        [
            (&self.perimeter, ink::PERIMETER),
            (&self.known, ink::KNOWN),
            (&self.sensed, ink::SENSED),
        ]
        .map(|(area, colour)| area.element(&format!("fill=\"{colour}\"")))
        .concat()
    }
}

/// A belief in square blocks of `side` cells.
struct Blocks<'a> {
    frame: &'a GridFrame,
    side: u32,
    states: Vec<CellState>,
}

/// The state of each block: hazard if any of its cells is, of the kind most of them are.
fn coarsened(frame: &GridFrame, cells: &[u8], block: u32) -> Vec<CellState> {
    let across = frame.cells.div_ceil(block) as usize;
    let mut tally = vec![[0_u32; 4]; across * across];
    for (row, line) in cells.chunks(frame.cells.max(1) as usize).enumerate() {
        for (col, &byte) in line.iter().enumerate() {
            let at = row / block as usize * across + col / block as usize;
            tally[at][CellState::from_byte(byte) as usize] += 1;
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

impl Blocks<'_> {
    /// Everything of one kind: runs along x, joined along y where they are alike.
    fn area(&self, view: &View, kind: CellState) -> Path {
        let across = self.frame.cells.div_ceil(self.side);
        let mut path = Path::default();
        let mut open: Vec<Run> = Vec::new();
        for (row, line) in (0..).zip(self.states.chunks(across.max(1) as usize)) {
            let (grown, ended) = continued(open, runs(line, kind), row);
            for run in ended {
                self.draw(view, &mut path, run, row);
            }
            open = grown;
        }
        for run in open {
            self.draw(view, &mut path, run, across);
        }
        path
    }

    fn draw(&self, view: &View, path: &mut Path, run: Run, end_row: u32) {
        // The last block of a row may be cut short by the map's edge.
        let edge = |block: u32| f64::from((block * self.side).min(self.frame.cells)) - 0.5;
        let corner = |col: u32, row: u32| {
            let at = metres(self.frame, DVec2::new(edge(col), edge(row)));
            view.place(at)
        };
        let (low, high) = (corner(run.from, run.since), corner(run.until, end_row));
        path.rectangle(
            DVec2::new(low.x, high.y),
            DVec2::new(high.x - low.x, low.y - high.y),
        );
    }
}

/// Blocks `from..until` of one kind, alike in every row from `since` on.
#[derive(Clone, Copy)]
struct Run {
    from: u32,
    until: u32,
    since: u32,
}

/// The runs of `kind` in one row, as (from, until).
fn runs(line: &[CellState], kind: CellState) -> Vec<(u32, u32)> {
    let mut found: Vec<(u32, u32)> = Vec::new();
    for (col, state) in (0..).zip(line) {
        if *state != kind {
            continue;
        }
        match found.last_mut() {
            Some((_, until)) if *until == col => *until += 1,
            _ => found.push((col, col + 1)),
        }
    }
    found
}

/// The runs that are open after `row`, and those that ended before it.
fn continued(open: Vec<Run>, row_runs: Vec<(u32, u32)>, row: u32) -> (Vec<Run>, Vec<Run>) {
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
    use super::*;

    fn frame(cells: u32) -> GridFrame {
        GridFrame {
            cells,
            resolution_m: 8.0 / f64::from(cells),
            centre: DVec2::ZERO,
        }
    }

    #[test]
    fn alike_runs_become_one_rectangle_where_the_cells_lie() {
        let frame = frame(8);
        let mut cells = [0_u8; 64];
        for at in [2 * 8 + 1, 2 * 8 + 2, 3 * 8 + 1, 3 * 8 + 2, 4 * 8 + 1] {
            cells[at] = 1;
        }
        let hazard = BelievedHazard::of(&View::of(&frame), &frame, &cells);
        let two = "M162 492h200v200h-200z";
        let one = "M162 392h100v100h-100z";
        assert!(hazard.sensed.element("").contains(&format!("{two}{one}")));
        assert!(!hazard.has_known() && !hazard.has_perimeter());
    }

    #[test]
    fn a_belief_in_shreds_stays_within_its_budget() {
        let frame = frame(1024);
        let cells: Vec<u8> = (0..frame.area())
            .map(|at| ((at / 1024 + at % 1024) % 2) as u8)
            .collect();
        let hazard = BelievedHazard::of(&View::of(&frame), &frame, &cells);
        assert!(hazard.has_sensed() && hazard.len() <= BUDGET);
    }
}
