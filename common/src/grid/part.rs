//! Part of a map's version in a sample. Why `unsafe` is allowed here: as in [`crate::samples`].
#![allow(unsafe_code)]

use glam::DVec2;

use bus::ZeroCopySend;
use mission::grid::{GridFrame, Window};

crate::structs! {
    /// Frame of a map and window of one version, in the headers of `grid` and `field`.
    "firsthand.Part" Part {
        /// Version of the map with these cells. Consecutive versions differ in one window; an empty
        /// one means no change.
        version: u64,
        /// N: the map is N x N cells.
        cells: u32,
        col: u32,
        row: u32,
        width: u32,
        height: u32,
        /// 1: the window is the whole map. Otherwise it changes the version before.
        keyframe: u32,
        /// Delta: side of a cell, metres.
        resolution_m: f64,
        /// Centre of cell (N/2, N/2), metres.
        centre_x_m: f64,
        centre_y_m: f64,
    }
}

impl Part {
    pub const fn of(frame: GridFrame, window: Window, version: u64) -> Self {
        Self {
            version,
            cells: frame.cells,
            col: window.col,
            row: window.row,
            width: window.width,
            height: window.height,
            keyframe: 0,
            resolution_m: frame.resolution_m,
            centre_x_m: frame.centre.x,
            centre_y_m: frame.centre.y,
        }
    }

    pub const fn whole(frame: GridFrame, version: u64) -> Self {
        Self { keyframe: 1, ..Self::of(frame, frame.whole(), version) }
    }

    pub const fn frame(&self) -> GridFrame {
        GridFrame {
            cells: self.cells,
            resolution_m: self.resolution_m,
            centre: DVec2::new(self.centre_x_m, self.centre_y_m),
        }
    }

    pub const fn window(&self) -> Window {
        Window { col: self.col, row: self.row, width: self.width, height: self.height }
    }

    pub const fn is_keyframe(&self) -> bool {
        self.keyframe == 1
    }
}
