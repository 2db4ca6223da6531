//! ROS map, and the cells that the robot's centre must not enter. Pure.

use glam::{DAffine2, DVec2};
use harmonic::{Cell, MAX_SIDE};
use ros2::{
    cdr::Cdr,
    msg::{OccupancyGrid, OccupancyGridUpdate},
};

/// Distance beyond which obstacles have no effect, in metres and in cells.
const REACH_M: f64 = 1.0;
const MOST_REACH: f64 = 60.0;
/// Cost of a cell of value 98, relative to a free cell at the same distance from obstacles.
///
/// NavFn has no other costs and uses 5, with which long paths avoid gaps that are wide enough.
const DEAREST: f32 = 3.0;

/// Rules for blocked cells of any map.
#[derive(Clone, Copy, Debug, Default)]
pub struct Body {
    /// Least distance of the robot's centre from occupied cells, metres.
    pub radius_m: f64,
    /// Least value of occupied cells, up to 100.
    pub occupied: u8,
    pub enters_unknown: bool,
}

impl Body {
    fn is_occupied(&self, value: i8) -> bool {
        if value < 0 { !self.enters_unknown } else { value as u8 >= self.occupied }
    }
}

#[derive(Clone, Debug)]
pub struct Costmap {
    pub frame: String,
    pub width: usize,
    pub height: usize,
    pub resolution_m: f64,
    /// Transform from cells, with centres at integers, to the map's frame.
    pub place: DAffine2,
    cells: Vec<i8>,
}

impl Costmap {
    pub fn read(payload: &[u8]) -> Result<Self, String> {
        let OccupancyGrid { header, info, data: cells } = OccupancyGrid::decode(payload)?;
        let resolution_m = f64::from(info.resolution);
        let [width, height] = [info.width, info.height].map(|side| side as usize);
        let (origin, heading) = (info.origin.at(), info.origin.orientation.heading());
        let heading = heading.ok_or("the origin's orientation is not a rotation")?;
        let scale = DVec2::splat(resolution_m);
        let corner = DAffine2::from_scale_angle_translation(scale, heading, origin.into());
        let fits = |side| (1..=MAX_SIDE).contains(&side);
        if !(resolution_m > 0.0 && corner.is_finite() && fits(width) && fits(height)) {
            return Err(format!(
                "the size, resolution or origin is invalid: {width} x {height} cells of {resolution_m} m at {origin:?}"
            ));
        }
        if cells.len() != width * height {
            return Err(format!("the map has {} cells instead of {width} x {height}", cells.len()));
        }
        Ok(Self {
            frame: header.frame_id,
            width,
            height,
            resolution_m,
            place: corner * DAffine2::from_translation(DVec2::splat(0.5)),
            cells,
        })
    }

    /// Applies a `map_msgs/OccupancyGridUpdate`, completely or not at all.
    pub fn update(&mut self, payload: &[u8]) -> Result<(), String> {
        let OccupancyGridUpdate { x, y, width, height, data, .. } = Cdr::decode(payload)?;
        let [col, row, width, height] = [x as u32, y as u32, width, height].map(|it| it as usize);
        let is_inside = col + width <= self.width && row + height <= self.height;
        if !is_inside || data.len() != width * height {
            return Err(format!(
                "the update does not fit the map: {width} x {height} cells at ({col}, {row})"
            ));
        }
        for (from, row) in data.chunks_exact(width.max(1)).zip(row..) {
            let at = row * self.width + col;
            self.cells[at..at + width].copy_from_slice(from);
        }
        Ok(())
    }

    pub fn cell_at(&self, at: DVec2) -> Option<Cell> {
        let [col, row] = at.round().to_array();
        let is_inside =
            (0.0..self.width as f64).contains(&col) && (0.0..self.height as f64).contains(&row);
        is_inside.then(|| Cell::new(col as usize, row as usize))
    }

    pub fn is_occupied(&self, cell: Cell, body: &Body) -> bool {
        body.is_occupied(self.cells[cell.row * self.width + cell.col])
    }

    /// Returns the blocked cells and the cost of each cell.
    ///
    /// A cell is blocked if it is occupied, or if its centre is within the body's radius of an
    /// occupied one. The cost is the inverse square of the distance from obstacles in metres, up to
    /// [`REACH_M`]. The cell's value scales it by up to [`DEAREST`]. `most` limits it.
    pub fn blocked_and_costs(&self, body: &Body, most: f32) -> (Vec<bool>, Vec<f32>) {
        let cells = |metres: f64| (metres / self.resolution_m).clamp(0.0, MAX_SIDE as f64);
        let (radius, reach) = (cells(body.radius_m), cells(REACH_M).min(MOST_REACH));
        // In an inflated costmap, 99 means that a robot at this cell touches an obstacle. The cell
        // itself is free.
        let touches = |value| radius == 0.0 && value == 99;
        let obstacle = |value| body.is_occupied(value) && !touches(value);
        let squares = self.squares(radius.max(reach) as usize, obstacle);
        let (radius, a_metre) = ((radius * radius) as f32, self.resolution_m.powi(-2) as f32);
        let dear = |value: i8| 1.0 + (DEAREST - 1.0) / 98.0 * f32::from(value.max(0));
        squares
            .iter()
            .zip(&self.cells)
            .map(|(&square, &value)| {
                let is_blocked = square <= radius || body.is_occupied(value);
                (is_blocked, (a_metre / square.max(1.0) * dear(value)).min(most))
            })
            .unzip()
    }

    /// Returns the squared distance in cells to the nearest source cell, or (`reach` + 1)² out of
    /// reach.
    ///
    /// `f32`, because every processor has a vector minimum for it.
    fn squares(&self, reach: usize, is_source: impl Fn(i8) -> bool) -> Vec<f32> {
        let beyond = reach as u16 + 1;
        let square = |cells: u16| f32::from(cells).powi(2);
        // Distance of each cell from a source in its row.
        let mut gaps = vec![0; self.width];
        let mut along = Vec::with_capacity(self.cells.len());
        for cells in self.cells.chunks_exact(self.width) {
            for (gap, &value) in gaps.iter_mut().zip(cells) {
                *gap = if is_source(value) { 0 } else { beyond };
            }
            spread(gaps.iter_mut());
            spread(gaps.iter_mut().rev());
            along.extend(gaps.iter().map(|&gap| square(gap)));
        }
        let mut squares = vec![square(beyond); along.len()];
        for (row, squares) in squares.chunks_exact_mut(self.width).enumerate() {
            for other in row.saturating_sub(reach)..self.height.min(row + reach + 1) {
                let across = (other.abs_diff(row) as f32).powi(2);
                for (square, along) in squares.iter_mut().zip(&along[other * self.width..]) {
                    let by = along + across;
                    *square = if by < *square { by } else { *square };
                }
            }
        }
        squares
    }
}

/// Limits each number to its predecessor plus one.
fn spread<'a>(numbers: impl Iterator<Item = &'a mut u16>) {
    let mut before = u16::MAX;
    for number in numbers {
        *number = (*number).min(before.saturating_add(1));
        before = *number;
    }
}
