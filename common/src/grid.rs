//! Cells and metres: the frame of the map, windows of it, and a replica that follows its versions.

use glam::DVec2;
use serde::{Deserialize, Serialize};

/// What is believed of a cell: (18), (19) and the a-priori map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u8)]
pub enum CellState {
    /// Possibly safe: 0 in the paper's DSE.
    Free = 0,
    /// A safety event, or its margin, was mapped here.
    Sensed = 1,
    /// Hazard from the a-priori map of the mission.
    Known = 2,
    /// The perimeter of operation; never cleared.
    Perimeter = 3,
    /// Possibly safe, and the sonar looked there: only the careful method tells it from [`Free`](Self::Free).
    Swept = 4,
    /// Hazard because the body would touch something sensed nearby; the sonar looked there and saw nothing.
    Margin = 5,
}

impl CellState {
    /// Whether the harmonic field is 0 here.
    #[must_use]
    pub const fn is_hazard(self) -> bool {
        !matches!(self, Self::Free | Self::Swept)
    }

    /// Whether the sonar looked here.
    #[must_use]
    pub const fn is_swept(self) -> bool {
        matches!(self, Self::Swept | Self::Margin)
    }

    /// The state a byte of the `grid` topic stands for; anything unheard of is a hazard.
    #[must_use]
    pub const fn from_byte(byte: u8) -> Self {
        match byte {
            0 => Self::Free,
            1 => Self::Sensed,
            2 => Self::Known,
            4 => Self::Swept,
            5 => Self::Margin,
            _ => Self::Perimeter,
        }
    }
}

/// The most cells along a side: 4096 x 4096 is the largest field that is solved.
pub const MAX_CELLS: u32 = 4096;

/// A cell: `col` grows with x, `row` grows with y.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Cell {
    /// Index along x.
    pub col: u32,
    /// Index along y.
    pub row: u32,
}

/// A rectangle of cells; empty when either extent is 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Window {
    /// First column.
    pub col: u32,
    /// First row.
    pub row: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Window {
    /// Cells it covers.
    #[must_use]
    pub const fn area(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// The smallest window that covers `self` and `cell`.
    #[must_use]
    pub fn including(self, cell: Cell) -> Self {
        if self.area() == 0 {
            return Self {
                col: cell.col,
                row: cell.row,
                width: 1,
                height: 1,
            };
        }
        let (col, row) = (self.col.min(cell.col), self.row.min(cell.row));
        Self {
            col,
            row,
            width: (self.col + self.width).max(cell.col + 1) - col,
            height: (self.row + self.height).max(cell.row + 1) - row,
        }
    }
}

/// How the N x N cells of the map lie in the mission frame: (19) with the origin at the centre.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GridFrame {
    /// N: cells along each side.
    pub cells: u32,
    /// Delta: the side of a cell, metres.
    pub resolution_m: f64,
    /// Where the centre cell lies in the mission frame, metres.
    pub centre: DVec2,
}

impl GridFrame {
    /// The index of the cell at the centre, along both axes.
    #[must_use]
    pub const fn centre_index(&self) -> u32 {
        self.cells / 2
    }

    /// Number of cells, N x N.
    #[must_use]
    pub const fn area(&self) -> usize {
        self.cells as usize * self.cells as usize
    }

    /// `point` (metres) in cell units: cell centres lie at whole numbers.
    #[must_use]
    pub fn to_cells(&self, point: DVec2) -> DVec2 {
        (point - self.centre) / self.resolution_m + DVec2::splat(f64::from(self.centre_index()))
    }

    /// The cell `point` falls in, [x / Delta] of (19); none outside the map.
    #[must_use]
    pub fn cell_at(&self, point: DVec2) -> Option<Cell> {
        let index = self.to_cells(point).round();
        let last = f64::from(self.cells) - 1.0;
        // Written so that NaN falls out too.
        if !(index.cmpge(DVec2::ZERO).all() && index.cmple(DVec2::splat(last)).all()) {
            return None;
        }
        Some(Cell {
            col: index.x as u32,
            row: index.y as u32,
        })
    }

    /// The middle of `cell` in the mission frame, metres.
    #[must_use]
    pub fn centre_of(&self, cell: Cell) -> DVec2 {
        let centre = f64::from(self.centre_index());
        let offset = DVec2::new(f64::from(cell.col) - centre, f64::from(cell.row) - centre);
        self.centre + offset * self.resolution_m
    }

    /// Position of `cell` in a row-major slice of the whole map.
    #[must_use]
    pub const fn index(&self, cell: Cell) -> usize {
        cell.row as usize * self.cells as usize + cell.col as usize
    }

    /// Whether `cell` is on the perimeter, (18).
    #[must_use]
    pub const fn is_rim(&self, cell: Cell) -> bool {
        let last = self.cells - 1;
        cell.col == 0 || cell.row == 0 || cell.col >= last || cell.row >= last
    }

    /// The window of the whole map.
    #[must_use]
    pub const fn whole(&self) -> Window {
        Window {
            col: 0,
            row: 0,
            width: self.cells,
            height: self.cells,
        }
    }

    /// The cells of `window` out of a row-major slice of the whole map, in order.
    pub fn cells_of<'map, T: Copy>(
        &self,
        window: Window,
        map: &'map [T],
    ) -> impl ExactSizeIterator<Item = T> + use<'map, T> {
        let (frame, width) = (*self, window.width.max(1));
        (0..window.area() as u32).map(move |offset| {
            map[frame.index(Cell {
                col: window.col + offset % width,
                row: window.row + offset / width,
            })]
        })
    }

    /// The smallest window outside of which two whole maps are the same; empty if they are.
    #[must_use]
    pub fn changed_window<T: PartialEq>(&self, old: &[T], new: &[T]) -> Window {
        let side = self.cells as usize;
        let mut window = Window::default();
        let rows = old.chunks_exact(side).zip(new.chunks_exact(side));
        for (row, (old, new)) in rows.enumerate() {
            let differs = |(old, new): (&T, &T)| old != new;
            let first = old.iter().zip(new).position(differs);
            let last = old.iter().zip(new).rposition(differs);
            for col in [first, last].into_iter().flatten() {
                window = window.including(Cell {
                    col: col as u32,
                    row: row as u32,
                });
            }
        }
        window
    }

    /// Whether `window` lies inside the map.
    #[must_use]
    pub fn contains(&self, window: Window) -> bool {
        let fits = |from: u32, extent: u32| {
            from.checked_add(extent)
                .is_some_and(|end| end <= self.cells)
        };
        fits(window.col, window.width) && fits(window.row, window.height)
    }
}

/// Which part of which version of a map a sample carries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Revision {
    /// How the map lies.
    pub frame: GridFrame,
    /// The cells that came along, row-major.
    pub window: Window,
    /// The version the map has with them.
    pub version: u64,
    /// Whether they are the whole map. Otherwise they change the version before.
    pub keyframe: bool,
}

/// What became of a revision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Applied {
    /// The whole map came, and nothing was held before to compare it with.
    Whole,
    /// The window changed; nothing, if it is empty.
    Window(Window),
    /// A version is missing, or the cells do not fit: the map is as it was, wait for a keyframe.
    Missed,
}

/// A follower's copy of a map that is published in keyframes and windows.
#[derive(Clone, Debug, Default)]
pub struct Replica<T> {
    cells: Vec<T>,
    state: Option<(GridFrame, u64)>,
}

impl<T: Copy + PartialEq> Replica<T> {
    /// The frame, once a keyframe has come.
    #[must_use]
    pub fn frame(&self) -> Option<GridFrame> {
        self.state.map(|(frame, _)| frame)
    }

    /// The version held; 0 before the first keyframe.
    #[must_use]
    pub fn version(&self) -> u64 {
        self.state.map_or(0, |(_, version)| version)
    }

    /// All cells, row-major; empty before the first keyframe.
    #[must_use]
    pub fn cells(&self) -> &[T] {
        &self.cells
    }

    /// Follow one revision.
    pub fn apply(&mut self, revision: &Revision, cells: &[T]) -> Applied {
        let Revision {
            frame,
            window,
            version,
            keyframe,
        } = *revision;
        let sane = (1..=MAX_CELLS).contains(&frame.cells);
        if !sane || !frame.contains(window) || cells.len() != window.area() {
            return Applied::Missed;
        }
        if keyframe {
            if window != frame.whole() {
                return Applied::Missed;
            }
            // A keyframe for late joiners must not look like more than what changed, or a consumer that
            // attaches would change what the others compute.
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
        let nothing = version == held && window.area() == 0;
        let follows = nothing || held.checked_add(1) == Some(version);
        if held_frame != frame || !follows {
            self.state = None;
            return Applied::Missed;
        }
        for (offset, row) in cells.chunks_exact(window.width.max(1) as usize).enumerate() {
            let start = frame.index(Cell {
                col: window.col,
                row: window.row + offset as u32,
            });
            self.cells[start..start + row.len()].copy_from_slice(row);
        }
        self.state = Some((frame, version));
        Applied::Window(window)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(cells: u32) -> GridFrame {
        GridFrame {
            cells,
            resolution_m: 0.1,
            centre: DVec2::ZERO,
        }
    }

    #[test]
    fn equation_19_rounds_to_the_cell_with_the_origin_at_the_centre() {
        let frame = frame(50);
        let at = |x, y| frame.cell_at(DVec2::new(x, y));
        assert_eq!(at(0.0, 0.0), Some(Cell { col: 25, row: 25 }));
        assert_eq!(at(0.26, -0.14), Some(Cell { col: 28, row: 24 }));
        assert_eq!(at(2.4, -2.5), Some(Cell { col: 49, row: 0 }));
        assert_eq!(at(2.46, 0.0), None, "one past the last column");
        assert_eq!(at(f64::NAN, 0.0), None);
    }

    #[test]
    fn a_cell_centre_falls_in_its_own_cell() {
        let frame = GridFrame {
            centre: DVec2::new(1.3, -0.7),
            ..frame(41)
        };
        for cell in [Cell { col: 0, row: 40 }, Cell { col: 17, row: 3 }] {
            assert_eq!(frame.cell_at(frame.centre_of(cell)), Some(cell));
        }
    }

    #[test]
    fn a_replica_follows_windows_and_drops_the_map_when_one_is_missing() {
        let frame = frame(4);
        let mut replica = Replica::default();
        let part = Window {
            col: 1,
            row: 2,
            width: 2,
            height: 1,
        };
        let change = |version| Revision {
            frame,
            window: part,
            version,
            keyframe: false,
        };
        assert_eq!(replica.apply(&change(2), &[1, 1]), Applied::Missed);
        let whole = Revision {
            frame,
            window: frame.whole(),
            version: 1,
            keyframe: true,
        };
        assert_eq!(replica.apply(&whole, &[0_u8; 16]), Applied::Whole);
        assert_eq!(replica.apply(&change(2), &[1, 2]), Applied::Window(part));
        assert_eq!(replica.cells()[8..12], [0, 1, 2, 0]);
        assert_eq!(replica.apply(&change(4), &[1, 1]), Applied::Missed);
        assert_eq!(replica.frame(), None, "a gap makes the copy worthless");
    }

    #[test]
    fn a_keyframe_that_changes_one_cell_is_told_as_that_window() {
        let frame = frame(4);
        let mut replica = Replica::default();
        let keyframe = |version| Revision {
            frame,
            window: frame.whole(),
            version,
            keyframe: true,
        };
        let mut cells = [0_u8; 16];
        assert_eq!(replica.apply(&keyframe(1), &cells), Applied::Whole);
        let nothing = Applied::Window(Window::default());
        assert_eq!(replica.apply(&keyframe(1), &cells), nothing);
        cells[9] = 1;
        let one = Window {
            col: 1,
            row: 2,
            width: 1,
            height: 1,
        };
        assert_eq!(replica.apply(&keyframe(2), &cells), Applied::Window(one));
    }

    #[test]
    fn a_map_without_cells_is_refused() {
        let none = Revision {
            frame: frame(0),
            window: Window::default(),
            version: u64::MAX,
            keyframe: true,
        };
        let mut replica = Replica::<u8>::default();
        for _ in 0..2 {
            assert_eq!(replica.apply(&none, &[]), Applied::Missed);
        }
    }

    #[test]
    fn a_window_that_does_not_fit_is_refused() {
        let frame = frame(4);
        let mut replica = Replica::default();
        let outside = Revision {
            frame,
            window: Window {
                col: 3,
                row: 0,
                width: u32::MAX,
                height: 1,
            },
            version: 1,
            keyframe: false,
        };
        assert_eq!(replica.apply(&outside, &[0_u8; 1]), Applied::Missed);
    }
}
