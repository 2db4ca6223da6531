use common::{
    grid::{Applied, Cell, CellState, GridFrame, Replica},
    samples::GridHeader,
};
use glam::DVec2;

/// Step along a line of sight, in cells.
const SIGHT_STEP: f64 = 0.1;

#[derive(Clone, Default)]
pub struct Belief {
    grid: Replica<u8>,
    pub header: GridHeader,
}

/// Complete map whose hazard cells include the body's margin.
#[derive(Clone, Copy, Debug)]
pub struct Map<'a> {
    pub frame: GridFrame,
    cells: &'a [u8],
}

impl Belief {
    /// Applies one `grid` sample. Returns false if a version is missing; the map is then absent
    /// until a keyframe.
    pub fn follow(&mut self, header: &GridHeader, cells: &[u8]) -> bool {
        let followed = self.grid.apply(&header.part, cells) != Applied::Missed;
        if followed {
            self.header = *header;
        }
        followed
    }

    pub fn map(&self) -> Option<Map<'_>> {
        let frame = self.grid.frame()?;
        Some(Map { frame, cells: self.grid.cells() })
    }
}

impl Map<'_> {
    pub fn is_free(&self, cell: Cell) -> bool {
        let inside = cell.col < self.frame.cells && cell.row < self.frame.cells;
        let byte = self.cells.get(self.frame.index(cell)).filter(|_| inside);
        byte.is_some_and(|&byte| !CellState::from_byte(byte).is_hazard())
    }

    pub fn free_cell_at(&self, point: DVec2) -> Option<Cell> {
        self.frame.cell_at(point).filter(|&cell| self.is_free(cell))
    }

    pub fn free_neighbour(&self, cell: Cell, [cols, rows]: [i32; 2]) -> Option<Cell> {
        let col = cell.col.checked_add_signed(cols)?;
        let row = cell.row.checked_add_signed(rows)?;
        Some(Cell { col, row }).filter(|&next| self.is_free(next))
    }

    /// Returns whether the line between two points, metres, is free.
    pub fn sees(&self, from: DVec2, to: DVec2) -> bool {
        let steps = (from.distance(to) / (SIGHT_STEP * self.frame.resolution_m)).ceil();
        let steps = steps.clamp(1.0, f64::from(u32::MAX)) as u32;
        let at = |step: u32| from.lerp(to, f64::from(step) / f64::from(steps));
        (0..=steps).all(|step| self.free_cell_at(at(step)).is_some())
    }

    pub fn nearest_free(&self, point: DVec2) -> Option<DVec2> {
        let free = self.frame.whole().cells().filter(|&cell| self.is_free(cell));
        let centres = free.map(|cell| self.frame.centre_of(cell));
        centres.min_by(|a, b| a.distance(point).total_cmp(&b.distance(point)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baselines::{testing::drawn, wavefront::shortest_path};

    fn belief(rows: &[&str]) -> Belief {
        let (header, cells) = drawn(rows);
        let mut belief = Belief::default();
        assert!(belief.follow(&header, &cells));
        belief
    }

    const CORNER: [&str; 5] = [
        ".....", //
        ".....", //
        "..##.", //
        "..#..", //
        ".....",
    ];

    #[test]
    fn a_line_of_sight_ends_at_a_hazard() {
        let belief = belief(&CORNER);
        let map = belief.map().unwrap();
        let sees = |from: [f64; 2], to: [f64; 2]| map.sees(from.into(), to.into());
        assert!(sees([-0.2, 0.1], [0.2, 0.1]));
        assert!(!sees([-0.2, 0.0], [0.2, 0.0]));
    }

    #[test]
    fn a_step_cuts_no_corner() {
        let belief = belief(&CORNER);
        let map = belief.map().unwrap();
        let (from, to) = (Cell { col: 1, row: 2 }, Cell { col: 2, row: 3 });
        let path = shortest_path(&map, from, to);
        let around = vec![from, Cell { col: 1, row: 3 }, to];
        assert_eq!(path, Some(around), "past the corner");
        assert_eq!(map.free_neighbour(from, [0, 1]), Some(Cell { col: 1, row: 3 }));
        assert_eq!(map.free_neighbour(Cell { col: 0, row: 0 }, [-1, 0]), None);
    }

    #[test]
    fn out_of_a_hazard_the_nearest_free_cell_is_found_and_none_where_there_is_none() {
        let belief = belief(&CORNER);
        let nearest = belief.map().unwrap().nearest_free(DVec2::new(0.02, 0.01));
        assert_eq!(nearest, Some(DVec2::new(0.0, 0.1)));
        let (header, cells) = drawn(&["###"; 3]);
        let mut full = Belief::default();
        full.follow(&header, &cells);
        assert_eq!(full.map().unwrap().nearest_free(DVec2::ZERO), None);
    }
}
