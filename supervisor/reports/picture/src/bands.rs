//! Background: pale bands between level sets of log2 u, each a constant factor of u wide.

use common::samples::FieldCell;
use glam::{DVec2, DVec3};

use super::{
    lattice::{Lattice, around},
    page::{Path, round_up},
};

pub(super) struct Style {
    /// Size limit of this layer, bytes; an irregular field gets coarser.
    pub budget: usize,
    /// Most samples along the longer side, enough for the width of the bands.
    pub finest: usize,
    pub bands: f64,
    /// Colours from the target outwards.
    pub ramp: &'static [[f64; 3]],
    pub stroke: &'static str,
}

/// Pale style, with as many bands as the eye can distinguish.
pub(super) const MISSION: Style = Style {
    budget: 130_000,
    finest: 160,
    bands: 12.0,
    ramp: &[
        [255.0, 250.0, 219.0],
        [226.0, 240.0, 214.0],
        [194.0, 224.0, 222.0],
        [173.0, 203.0, 226.0],
        [172.0, 182.0, 217.0],
    ],
    stroke: "stroke=\"#fff\" stroke-width=\"0.9\" stroke-opacity=\"0.75\"",
};

/// Share of the map allowed below the last level; u has no floor close to hazards.
const BELOW: f64 = 0.02;

/// Levels at -step, -2 step, ..., -count step of log2 u.
#[derive(Clone, Copy)]
pub(super) struct Levels {
    pub step: f64,
    pub count: u32,
    ramp: &'static [[f64; 3]],
}

impl Levels {
    pub(super) fn band(&self, log2_u: f32) -> u32 {
        // The cast saturates: the target's own level is the highest.
        ((-f64::from(log2_u) / self.step) as u32).min(self.count)
    }

    pub(super) fn colour(&self, nth: u32) -> String {
        let along = f64::from(nth) / f64::from(self.count.max(1)) * (self.ramp.len() - 1) as f64;
        let from = (along as usize).min(self.ramp.len() - 2);
        let part = along - from as f64;
        let [a, b] = [from, from + 1].map(|at| DVec3::from_array(self.ramp[at]));
        let [red, green, blue] =
            (a + (b - a) * part).round().to_array().map(|channel| channel as u8);
        format!("#{red:02x}{green:02x}{blue:02x}")
    }
}

pub(super) struct Bands<'a> {
    lattice: Lattice,
    cells: &'a [FieldCell],
    style: &'static Style,
    pub levels: Levels,
}

impl<'a> Bands<'a> {
    pub(super) fn of(
        lattice: &Lattice,
        cells: &'a [FieldCell],
        style: &'static Style,
    ) -> Option<Self> {
        let mut values: Vec<f32> = cells
            .iter()
            .map(|cell| cell.log2_u.min(0.0))
            .filter(|value| value.is_finite())
            .collect();
        let low = (values.len() as f64 * BELOW) as usize;
        if values.is_empty() {
            return None;
        }
        let (_, quantile, _) = values.select_nth_unstable_by(low, f32::total_cmp);
        let span = -f64::from(*quantile);
        let step = round_up(span / style.bands);
        Some(Self {
            lattice: *lattice,
            cells,
            style,
            levels: Levels {
                step,
                count: (span / step).ceil().clamp(1.0, 2.0 * style.bands) as u32,
                ramp: style.ramp,
            },
        })
    }

    pub(super) fn layer(&self) -> String {
        let mut finest = self.style.finest;
        loop {
            let areas = self.areas(finest);
            if areas.iter().map(Path::len).sum::<usize>() <= self.style.budget || finest < 8 {
                return self.paint(&areas);
            }
            finest /= 2;
        }
    }

    /// Returns the areas above each level, lowest first, at most `finest` samples a side.
    fn areas(&self, finest: usize) -> Vec<Path> {
        let samples = Samples::of(&self.lattice, self.cells, finest, self.levels);
        (1..=self.levels.count + 1)
            .rev()
            .map(|nth| samples.above(&self.lattice, -self.levels.step * f64::from(nth)))
            .collect()
    }

    fn paint(&self, areas: &[Path]) -> String {
        let painted: String = (0..=self.levels.count)
            .rev()
            .zip(areas)
            .map(|(nth, area)| area.element(&format!("fill=\"{}\"", self.levels.colour(nth))))
            .collect();
        format!(
            "<g fill-rule=\"evenodd\" {} stroke-linejoin=\"round\">\n{painted}</g>\n",
            self.style.stroke
        )
    }
}

/// Rings of samples around the map. The inner one continues the bands to the plot's edge. The outer
/// one is empty, so that every level set closes.
const AROUND: usize = 2;

/// Samples of log2 u at the middles of square blocks of cells, and [`AROUND`] them.
struct Samples {
    /// Number of samples, including those around the map.
    across: usize,
    down: usize,
    block: usize,
    /// Row-major values, all finite.
    values: Vec<f64>,
}

impl Samples {
    fn of(lattice: &Lattice, cells: &[FieldCell], finest: usize, levels: Levels) -> Self {
        let block = lattice.longest().div_ceil(finest).max(1);
        let across = lattice.cols.div_ceil(block) + 2 * AROUND;
        let down = lattice.rows.div_ceil(block) + 2 * AROUND;
        let mut sums = vec![(0.0, 0_u32); across * down];
        for (row, line) in cells.chunks(lattice.cols.max(1)).enumerate() {
            for (col, cell) in line.iter().enumerate() {
                if cell.log2_u.is_finite() {
                    let sum = &mut sums[(row / block + AROUND) * across + col / block + AROUND];
                    sum.0 += f64::from(cell.log2_u.min(0.0));
                    sum.1 += 1;
                }
            }
        }
        // Values far below the last level look alike; a floor keeps the level sets smooth.
        let last = -levels.step * f64::from(levels.count);
        let floor = last - 0.5 * levels.step;
        let nowhere = last - 2.0 * levels.step;
        let mean =
            |&(sum, count): &(f64, u32)| (count > 0).then(|| (sum / f64::from(count)).max(floor));
        let is_outermost = |at: usize| {
            let (col, row) = (at % across, at / across);
            col.min(row) == 0 || col == across - 1 || row == down - 1
        };
        let values = (0..sums.len())
            .map(|at| match mean(&sums[at]) {
                Some(value) => value,
                None if is_outermost(at) => nowhere,
                // The bands continue below hazard cells instead of following their outline.
                None => {
                    let sum = around([across, down], (at % across, at / across))
                        .map(|near| sums[near])
                        .fold((0.0, 0), |all, one| (all.0 + one.0, all.1 + one.1));
                    mean(&sum).unwrap_or(nowhere)
                }
            })
            .collect();
        Self { across, down, block, values }
    }

    fn above(&self, lattice: &Lattice, level: f64) -> Path {
        // Marching squares: crossings form chains with the area on the left.
        let mut next = vec![usize::MAX; 2 * self.values.len()];
        for row in 0..self.down - 1 {
            for col in 0..self.across - 1 {
                for (from, to) in self.passages(col, row, level) {
                    next[from] = to;
                }
            }
        }
        debug_assert!(next.iter().all(|to| *to == usize::MAX || next[*to] != usize::MAX));
        let mut path = Path::default();
        for start in 0..next.len() {
            let mut ring = Vec::new();
            let mut at = start;
            while next[at] != usize::MAX {
                ring.push(self.position(lattice, at, level));
                at = std::mem::replace(&mut next[at], usize::MAX);
            }
            if ring.len() > 2 {
                path.polygon(ring);
            }
        }
        path
    }

    /// Returns the passages through the square with lower left sample (col, row), from crossing to
    /// crossing.
    ///
    /// A crossing's index is even along x from its sample, odd along y.
    fn passages(&self, col: usize, row: usize, level: f64) -> impl Iterator<Item = (usize, usize)> {
        let at = row * self.across + col;
        // Counter-clockwise, each with the crossing on the way to the next.
        let inside = [at, at + 1, at + self.across + 1, at + self.across]
            .map(|corner| self.values[corner] >= level);
        let crossings = [2 * at, 2 * (at + 1) + 1, 2 * (at + self.across), 2 * at + 1];
        // A passage has the area on its left: from where the way leaves it to where it last entered.
        let leaves = (0..4).filter(move |&corner| inside[corner] && !inside[(corner + 1) % 4]);
        leaves.filter_map(move |corner| {
            let outside =
                (1..4).map(|back| (corner + 4 - back) % 4).find(|&before| !inside[before])?;
            Some((crossings[corner], crossings[outside]))
        })
    }

    fn position(&self, lattice: &Lattice, crossing: usize, level: f64) -> DVec2 {
        let from = crossing / 2;
        let to = from + if crossing.is_multiple_of(2) { 1 } else { self.across };
        let (a, b) = (self.values[from], self.values[to]);
        debug_assert!((a >= level) != (b >= level), "the line crosses the level");
        let part = ((level - a) / (b - a)).clamp(0.0, 1.0);
        let middle = |at: usize| {
            let block = self.block as f64;
            let centre = |index: usize| (index as f64 - AROUND as f64 + 0.5) * block - 0.5;
            DVec2::new(centre(at % self.across), centre(at / self.across))
        };
        lattice.place(middle(from).lerp(middle(to), part))
    }
}

#[cfg(test)]
mod tests {
    use common::grid::GridFrame;

    use super::{super::page::View, *};

    #[test]
    fn level_sets_close_around_the_whole_map_whatever_the_blocks() {
        for cells in [10, 160, 161, 500] {
            let frame =
                GridFrame { cells, resolution_m: 8.0 / f64::from(cells), centre: DVec2::ZERO };
            let lattice = Lattice::of_mission(&frame, &View::of(&frame));
            let field: Vec<FieldCell> = (0..frame.area())
                .map(|at| FieldCell { log2_u: -((at % 7) as f32), ..FieldCell::default() })
                .collect();
            let bands = Bands::of(&lattice, &field, &MISSION).unwrap();
            let lowest = bands.areas(MISSION.finest).swap_remove(0).element("");
            assert_eq!(lowest.matches('M').count(), 1, "one ring for N = {cells}");
            let corners: Vec<_> = lowest
                .split(['M', 'L', 'Z', '"'])
                .filter_map(|point| point.split_once(' '))
                .filter_map(|(x, y)| Some(DVec2::new(x.parse().ok()?, y.parse().ok()?)))
                .collect();
            let middle = lattice.place(DVec2::splat(f64::from(cells) / 2.0 - 0.5));
            assert!(corners.len() > 3);
            for corner in corners {
                let beyond = (corner - middle).abs().max_element();
                assert!(beyond >= 400.0, "{corner} is inside the plot of N = {cells}");
            }
        }
    }
}
