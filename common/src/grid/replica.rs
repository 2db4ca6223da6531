use glam::DVec2;
use mission::grid::{Cell, CellState, GridFrame, MAX_CELLS, Window};

use super::part::Part;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Applied {
    Whole,
    /// Changed window; an empty one is no change.
    Window(Window),
    /// The map stays until the next keyframe.
    Missed,
}

#[derive(Clone, Debug, Default)]
pub struct Replica<T> {
    cells: Vec<T>,
    state: Option<(GridFrame, u64)>,
}

impl<T: Copy + PartialEq> Replica<T> {
    /// `None` before the first keyframe.
    pub fn frame(&self) -> Option<GridFrame> {
        self.state.map(|(frame, _)| frame)
    }

    /// 0 before the first keyframe.
    pub fn version(&self) -> u64 {
        self.state.map_or(0, |(_, version)| version)
    }

    /// Row-major; empty before the first keyframe.
    pub fn cells(&self) -> &[T] {
        &self.cells
    }

    pub fn apply(&mut self, part: &Part, cells: &[T]) -> Applied {
        let frame = part.frame();
        let window = part.window();
        let version = part.version;
        let sane = (1..=MAX_CELLS).contains(&frame.cells);
        if !sane || !frame.contains(window) || cells.len() != window.area() {
            return Applied::Missed;
        }
        if part.is_keyframe() {
            if window != frame.whole() {
                return Applied::Missed;
            }
            // A keyframe for late joiners counts only as its difference, so that attaching
            // consumers leave the others' results unchanged.
            let known = self.state.is_some_and(|(held, _)| held == frame);
            let changed = known.then(|| frame.changed_window(&self.cells, cells));
            self.cells.clear();
            self.cells.extend_from_slice(cells);
            self.state = Some((frame, version));
            return changed.map_or(Applied::Whole, Applied::Window);
        }
        let Some((held_frame, held)) = self.state else {
            return Applied::Missed;
        };
        // Only a change makes a new version: a new one without cells means a missed part.
        let follows =
            if window.area() == 0 { version == held } else { held.checked_add(1) == Some(version) };
        if held_frame != frame || !follows {
            return Applied::Missed;
        }
        assert_eq!(self.cells.len(), frame.area());
        for (offset, row) in cells.chunks_exact(window.width.max(1) as usize).enumerate() {
            let start = frame.index(Cell { col: window.col, row: window.row + offset as u32 });
            self.cells[start..start + row.len()].copy_from_slice(row);
        }
        self.state = Some((frame, version));
        Applied::Window(window)
    }
}

/// Safety map, a [`CellState`] a cell.
impl Replica<u8> {
    /// Treats places outside the map, and all before the first keyframe, as hazards.
    pub fn is_hazard(&self, place: DVec2) -> bool {
        let index = self.frame().and_then(|frame| Some(frame.index(frame.cell_at(place)?)));
        index.is_none_or(|index| CellState::from_byte(self.cells[index]).is_hazard())
    }
}
