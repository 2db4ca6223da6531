//! A map as ROS has it, and the cells that the robot's centre must not enter. Pure.

use glam::{DAffine2, DVec2};
use harmonic::{Cell, MAX_SIDE};
use ros2::cdr::Reader;

/// A larger map is refused.
const MOST_CELLS: usize = 1 << 26;

/// What may not be entered, whichever the map.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body {
    /// The robot's centre stays so far from what is occupied, metres.
    pub(super) radius_m: f64,
    /// Cells of this value or more, up to 100, are occupied.
    pub(super) occupied: u8,
    /// Whether cells of which nothing is known are free.
    pub(super) enters_unknown: bool,
}

impl Body {
    fn is_occupied(&self, value: u8) -> bool {
        (value as i8).is_negative() && !self.enters_unknown
            || (self.occupied..=i8::MAX as u8).contains(&value)
    }
}

#[derive(Clone, Debug)]
pub(super) struct Costmap {
    pub(super) frame: String,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) resolution_m: f64,
    /// From cells, whose centres are at the integers, to the map's frame.
    pub(super) place: DAffine2,
    cells: Vec<u8>,
}

impl Costmap {
    /// A `nav_msgs/OccupancyGrid`. Each error here says why the message is refused.
    pub(super) fn read(payload: &[u8]) -> Result<Self, String> {
        let mut reader = Reader::new(payload)?;
        let (_stamp_ns, frame) = reader.header()?;
        let _loaded_ns = reader.time()?;
        let resolution_m = f64::from(reader.f32()?);
        let [width, height] = [reader.u32()? as usize, reader.u32()? as usize];
        let (origin, heading) = reader.pose()?;
        let heading = heading.ok_or("an origin whose orientation is no rotation")?;
        let scale = DVec2::splat(resolution_m);
        let corner = DAffine2::from_scale_angle_translation(scale, heading, origin.into());
        let fits = |side| (1..=MAX_SIDE).contains(&side);
        if !(resolution_m > 0.0 && corner.is_finite() && fits(width) && fits(height)) {
            return Err(format!("{width} x {height} cells of {resolution_m} m at {origin:?}"));
        }
        let count = reader.length(MOST_CELLS)?;
        if count != width * height {
            return Err(format!("{count} cells instead of {width} x {height}"));
        }
        Ok(Self {
            frame: frame.to_owned(),
            width,
            height,
            resolution_m,
            place: corner * DAffine2::from_translation(DVec2::splat(0.5)),
            cells: reader.raw(count)?.to_vec(),
        })
    }

    /// Take a `map_msgs/OccupancyGridUpdate`, whole or not at all.
    pub(super) fn update(&mut self, payload: &[u8]) -> Result<(), String> {
        let mut reader = Reader::new(payload)?;
        let _header = reader.header()?;
        let [col, row, width, height] =
            [reader.u32()?, reader.u32()?, reader.u32()?, reader.u32()?].map(|x| x as usize);
        let is_inside = col + width <= self.width && row + height <= self.height;
        if !is_inside || reader.length(MOST_CELLS)? != width * height {
            return Err(format!(
                "{width} x {height} cells at ({col}, {row}), which the map has not"
            ));
        }
        let window = reader.raw(width * height)?;
        for (from, row) in window.chunks_exact(width.max(1)).zip(row..) {
            let at = row * self.width + col;
            self.cells[at..at + width].copy_from_slice(from);
        }
        Ok(())
    }

    pub(super) fn cell_at(&self, at: DVec2) -> Option<Cell> {
        let [col, row] = at.round().to_array();
        let is_inside =
            (0.0..self.width as f64).contains(&col) && (0.0..self.height as f64).contains(&row);
        is_inside.then(|| Cell::new(col as usize, row as usize))
    }

    pub(super) fn is_occupied(&self, cell: Cell, body: &Body) -> bool {
        body.is_occupied(self.cells[cell.row * self.width + cell.col])
    }

    /// The cells with centres no farther than the body's radius from that of an occupied one.
    pub(super) fn blocked(&self, body: &Body) -> Vec<bool> {
        let radius = (body.radius_m / self.resolution_m).clamp(0.0, MAX_SIDE as f64);
        // How far each cell is from an occupied one of its row.
        let mut gaps = vec![u16::MAX; self.cells.len()];
        for (gaps, cells) in
            gaps.chunks_exact_mut(self.width).zip(self.cells.chunks_exact(self.width))
        {
            for (gap, &value) in gaps.iter_mut().zip(cells) {
                *gap = if body.is_occupied(value) { 0 } else { u16::MAX };
            }
            spread(gaps.iter_mut());
            spread(gaps.iter_mut().rev());
        }
        let mut blocked: Vec<bool> = gaps.iter().map(|&gap| f64::from(gap) <= radius).collect();
        for rows in 1..=radius as usize {
            let wide = (radius * radius - (rows * rows) as f64).sqrt() as u16;
            let shift = rows * self.width;
            let near = |(blocked, gap): (&mut bool, &u16)| *blocked |= *gap <= wide;
            blocked.iter_mut().skip(shift).zip(&gaps).for_each(near);
            blocked.iter_mut().zip(gaps.iter().skip(shift)).for_each(near);
        }
        blocked
    }
}

/// Each number is at most one more than that before it.
fn spread<'a>(numbers: impl Iterator<Item = &'a mut u16>) {
    let mut before = u16::MAX;
    for number in numbers {
        *number = (*number).min(before.saturating_add(1));
        before = *number;
    }
}
