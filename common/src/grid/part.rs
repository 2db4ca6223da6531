//! The part of a map's version that a sample carries.
//!
//! Why `unsafe` is allowed here: a [`Part`] lies in shared memory, and deriving `ZeroCopySend` writes an `unsafe impl`
//! that promises a self-contained type of uniform layout. Its fields are plain numbers in a `repr(C)` struct, so the
//! promise holds; nothing else here is unsafe.
#![allow(unsafe_code)]

use glam::DVec2;

use bus::{ZeroCopySend, layouts};
use mission::grid::{GridFrame, Window};

/// The frame of a map and the part of a version that a sample carries, in the headers of `grid` and `field`.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.Part")]
#[repr(C)]
pub struct Part {
    /// The version the map has with these cells. Consecutive versions differ in one window; an empty one says that nothing
    /// changed since this version.
    pub version: u64,
    /// N: the map is N x N cells.
    pub cells: u32,
    /// First column of the window.
    pub col: u32,
    /// First row of the window.
    pub row: u32,
    /// Columns of the window.
    pub width: u32,
    /// Rows of the window.
    pub height: u32,
    /// 1: the window is the whole map. Otherwise it changes the version before.
    pub keyframe: u32,
    /// Delta: side of a cell, metres.
    pub resolution_m: f64,
    /// X of cell (N/2, N/2), metres.
    pub centre_x_m: f64,
    /// Y of cell (N/2, N/2), metres.
    pub centre_y_m: f64,
}

layouts! {
    Part { version cells col row width height keyframe resolution_m centre_x_m centre_y_m }
}

impl Part {
    /// `window` of version `version` of a map that lies as `frame` says.
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

    /// All of version `version` of a map that lies as `frame` says: a keyframe.
    pub const fn whole(frame: GridFrame, version: u64) -> Self {
        Self { keyframe: 1, ..Self::of(frame, frame.whole(), version) }
    }

    /// The frame of the map.
    pub const fn frame(&self) -> GridFrame {
        GridFrame {
            cells: self.cells,
            resolution_m: self.resolution_m,
            centre: DVec2::new(self.centre_x_m, self.centre_y_m),
        }
    }

    /// The cells that the sample carries, row-major.
    pub const fn window(&self) -> Window {
        Window { col: self.col, row: self.row, width: self.width, height: self.height }
    }

    /// Whether the sample carries the whole map.
    pub const fn is_keyframe(&self) -> bool {
        self.keyframe == 1
    }
}
