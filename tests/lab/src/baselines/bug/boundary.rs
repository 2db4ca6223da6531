//! Boundary of a hazard, followed cell by cell with the hazard on the right.

use common::grid::Cell;
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::baselines::belief::Map;

/// Directions counter-clockwise from x: columns and rows.
const DIRECTIONS: [[i32; 2]; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];
const LEFT: usize = 1;
const BACK: usize = 2;
const RIGHT: usize = 3;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Place {
    pub cell: Cell,
    /// Direction in which the cell was entered, in quarter turns from x. The hazard is to its
    /// right, or behind on the right.
    heading: u8,
}

impl Place {
    /// Returns the place at `cell` whose boundary leads closest to `direction`; none without a
    /// hazard beside the cell.
    pub fn at(map: &Map<'_>, cell: Cell, direction: DVec2) -> Option<Self> {
        let along = |place: &Self| {
            let [cols, rows] = place.turned(0);
            DVec2::new(cols.into(), rows.into()).dot(direction)
        };
        (0..4)
            .map(|heading| Self { cell, heading })
            .filter(|place| place.is_on(map))
            .max_by(|a, b| along(a).total_cmp(&along(b)))
    }

    pub fn is_on(&self, map: &Map<'_>) -> bool {
        let [[cols, rows], back] = [RIGHT, BACK].map(|turn| self.turned(turn));
        let behind = [cols + back[0], rows + back[1]];
        let is_hazard = |step| map.free_neighbour(self.cell, step).is_none();
        map.is_free(self.cell) && (is_hazard([cols, rows]) || is_hazard(behind))
    }

    /// Returns the next free cell: right, ahead, left or behind; none in a closed cell.
    pub fn next(&self, map: &Map<'_>) -> Option<Self> {
        [RIGHT, 0, LEFT, BACK].into_iter().find_map(|turn| {
            let cell = map.free_neighbour(self.cell, self.turned(turn))?;
            let heading = (usize::from(self.heading) + turn) % DIRECTIONS.len();
            Some(Self { cell, heading: heading as u8 })
        })
    }

    fn turned(&self, turn: usize) -> [i32; 2] {
        DIRECTIONS[(usize::from(self.heading) + turn) % DIRECTIONS.len()]
    }
}
