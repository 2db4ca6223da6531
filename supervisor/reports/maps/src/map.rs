use common::geometry::Box2;
use glam::DVec2;

/// Largest number of boxes. A mission file with them has 2 MB.
pub const MOST_BOXES: usize = 20_000;

/// Row-major cells, row 0 at the top.
#[derive(Debug)]
pub struct Map {
    pub cols: usize,
    pub rows: usize,
    /// Blocked cells, with the whole rim unless only occupied cells count.
    pub blocked: Vec<bool>,
}

#[derive(Debug)]
pub struct PlacedMap {
    pub map: Map,
    pub cell_m: f64,
    /// Corner of least x and y.
    pub corner_m: [f64; 2],
}

impl Map {
    /// Takes whole rows of `cols` cells each.
    pub(crate) fn new(cols: usize, free: impl IntoIterator<Item = bool>) -> Self {
        let blocked: Vec<bool> = free.into_iter().map(|free| !free).collect();
        let rows = blocked.len() / cols;
        assert_eq!(blocked.len(), cols * rows);
        Self { cols, rows, blocked }
    }

    /// Blocks the rim like a mission's perimeter.
    pub(crate) fn with_rim(mut self) -> Self {
        for (row, line) in self.blocked.chunks_mut(self.cols).enumerate() {
            if row == 0 || row + 1 == self.rows {
                line.fill(true);
            }
            line[0] = true;
            line[self.cols - 1] = true;
        }
        self
    }

    /// Returns column and row, or `None` if no cell is free.
    pub fn nearest_free(&self, col: usize, row: usize) -> Option<(usize, usize)> {
        self.blocked
            .iter()
            .enumerate()
            .filter(|cell| !cell.1)
            .map(|(at, _)| (at % self.cols, at / self.cols))
            .min_by_key(|cell| {
                let (x, y) = (cell.0.abs_diff(col) as u64, cell.1.abs_diff(row) as u64);
                // Saturates, because distances far outside the map may overflow.
                x.saturating_mul(x).saturating_add(y.saturating_mul(y))
            })
    }
}

impl PlacedMap {
    /// Returns the point `cols` from the left and `rows` from the top, metres.
    pub fn place(&self, cols: f64, rows: f64) -> DVec2 {
        let up = self.map.rows as f64 - rows;
        DVec2::from(self.corner_m) + DVec2::new(cols, up) * self.cell_m
    }

    /// Returns boxes over the `wanted` cells within `solid` ones, lazily. Each grows right, then
    /// down.
    pub fn boxes(&self, solid: &[bool], mut wanted: Vec<bool>) -> impl Iterator<Item = Box2> {
        let Map { cols, rows, .. } = self.map;
        assert!(solid.len() == cols * rows && wanted.len() == solid.len());
        (0..wanted.len()).filter_map(move |first| {
            if !wanted[first] {
                return None;
            }
            let (col, row) = (first % cols, first / cols);
            let width = (first..(row + 1) * cols)
                .take_while(|&cell| solid[cell])
                .filter(|&cell| wanted[cell])
                .last()
                .map_or(1, |last| last - first + 1);
            let line = |row: usize| row * cols + col..row * cols + col + width;
            let covers = |row: &usize| {
                line(*row).all(|cell| solid[cell]) && line(*row).any(|cell| wanted[cell])
            };
            let height = (row..rows).take_while(covers).count();
            for row in row..row + height {
                wanted[line(row)].fill(false);
            }
            let least = self.place(col as f64, (row + height) as f64);
            let size_m = DVec2::new(width as f64, height as f64) * self.cell_m;
            Some(Box2 { at: least + size_m / 2.0, size_m, ..Box2::default() })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rim_of_a_map_is_blocked_and_nothing_else() {
        let map = Map::new(4, [true; 12]).with_rim();
        let free: Vec<usize> = (0..12).filter(|&at| !map.blocked[at]).collect();
        assert_eq!(free, [5, 6]);
        let map = Map::new(1, [true]).with_rim();
        assert_eq!(map.blocked, [true]);
    }

    #[test]
    fn the_nearest_free_cell_is_found_from_outside_too() {
        let map = Map::new(5, [true; 25]).with_rim();
        assert_eq!(map.nearest_free(0, 2), Some((1, 2)));
        assert_eq!(map.nearest_free(usize::MAX, 3), Some((1, 1)));
        let walled = Map::new(2, [true; 4]).with_rim();
        assert_eq!(walled.nearest_free(0, 0), None);
    }
}
