//! Finest level: the five-point equation itself.
//!
//! Even-even and odd-odd cells are red, the others black. Red cells have only black neighbours and
//! vice versa. One pass over the rows does all work between two visits to the coarser levels, so a
//! cycle reads the level from memory once.
//!
//! 1. The coarse correction goes to the black cells.
//! 2. Red is relaxed from black and needs no correction of its own.
//! 3. Black is relaxed from red, then red again.
//! 4. The changes of that last half sweep, summed over the red neighbours of a black cell, are
//!    exactly its residual. It is restricted at once.

use super::{
    coarse::Coarse,
    grid::{
        EE, EO, Grid, MARGIN, OE, OO, Planes, Scratch, Weights, around, correct, first, zero_values,
    },
};
use crate::{Cell, real::Real};

#[derive(Clone, Copy, Debug)]
pub(super) struct Source<R> {
    pub plane: usize,
    pub row: usize,
    pub at: usize,
    pub value: R,
}

impl<R> Source<R> {
    pub(super) fn of(grid: &Grid, cell: Cell, value: R) -> Self {
        assert!(cell.col < grid.width && cell.row < grid.height);
        let (plane, at) = grid.locate(cell.col, cell.row);
        Self { plane, row: cell.row / 2, at, value }
    }
}

/// Angle, in radians, above which a coarse correction leaves a direction unsettled.
///
/// The next correction is smaller by a factor of three or more, which leaves directions well within
/// a degree.
const TOLERANCE: f64 = 0.02;

/// Relative change of u by a coarse correction above which a cell counts as unsettled in any case.
const LARGEST_CHANGE: f64 = 0.05;

/// Threshold of a saddle point: change of u over two cells, relative to u, times the longer side of
/// the map.
///
/// Below it, the tolerance is that of a cell with this change.
const FLAT: f64 = 0.5;

#[derive(Debug, Default)]
pub(super) struct Finest<R> {
    pub grid: Grid,
    pub u: Planes<R>,
    /// 1 / diagonal; 0 if blocked.
    pub inverse: Planes<R>,
    pub weights: Weights<R>,
    /// Sorted by plane and row.
    pub sources: Vec<Source<R>>,
    scratch: Scratch<R>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Work<R> {
    pub share: R,
    pub sweeps: usize,
    pub descend: bool,
    /// Whether to count the unsettled cells.
    pub judged: bool,
}

impl<R: Real> Finest<R> {
    pub(super) fn reshape(&mut self, grid: Grid) {
        self.grid = grid;
        let planes = self.u.iter_mut().chain(&mut self.inverse).chain(&mut self.weights);
        zero_values(planes, grid.len());
        self.sources.clear();
        self.scratch.reset(&grid);
    }

    /// Applies the correction from `next`, sweeps and restricts the residual.
    ///
    /// Returns the number of unsettled even-even cells: direction turned by more than
    /// [`TOLERANCE`], or u changed by more than [`LARGEST_CHANGE`].
    #[inline(always)]
    pub(super) fn pass(&mut self, next: &mut Coarse<R>, work: Work<R>) -> usize {
        let Work { share, sweeps, descend, judged } = work;
        let (grid, strips, m) = (self.grid, self.grid.strips, MARGIN);
        let mut unsettled = 0;
        debug_assert!(self.sources.is_sorted_by_key(|source| (source.plane, source.row)));
        let mut scratch = std::mem::take(&mut self.scratch);
        scratch.change_oo[..m + grid.stride].fill(R::default());
        scratch.residual_eo[..m + grid.stride].fill(R::default());
        scratch.begin_correction(&next.grid, &next.u, share);
        for y in 0..=strips + sweeps {
            if y < strips {
                let (o, n) = grid.strip(y);
                let (upper, lower) =
                    scratch.correction_below(&grid, (&next.grid, &next.u), y, share);
                if judged {
                    unsettled += self.unsettled(o, upper, lower, n);
                }
                correct(&mut self.u, &self.weights, (upper, lower), o, n);
            }
            // Each sweep follows the previous one at a distance of one strip.
            for sweep in 0..sweeps {
                if (sweep..strips + sweep).contains(&y) {
                    self.relax(EE, y - sweep, None);
                }
                if (sweep + 1..=strips + sweep).contains(&y) {
                    for plane in [OO, OE, EO] {
                        self.relax(plane, y - sweep - 1, None);
                    }
                }
            }
            if !descend || y < sweeps {
                continue;
            }
            let y = y - sweeps;
            let Scratch { restricted, change_ee, change_oo, residual_eo, residual_oe, .. } =
                &mut scratch;
            if y < strips {
                self.relax(EE, y, Some(&mut change_ee[grid.buffered(y)[0]..]));
            }
            let Some(y) = y.checked_sub(1) else {
                continue;
            };
            let ((o, n), [first, second]) = (grid.strip(y), grid.buffered(y));
            if y + 1 == strips {
                // The margin beyond the last row stays unchanged.
                let beyond = second + (grid.strip_rows - 1) * grid.stride;
                change_ee[beyond..][..grid.stride].fill(R::default());
            }
            self.relax(OO, y, Some(&mut change_oo[second..]));
            // The residual of black cells is the sum of the changes of their red neighbours.
            // Blocked cells get one too, but their interpolation weights are zero.
            let (even, even_below) = (&change_ee[first..], &change_ee[second..]);
            let (odd_above, odd) = (&change_oo[first - 1..], &change_oo[second - 1..]);
            let odd_even = [even, &even[1..], &odd_above[1..], &odd[1..]];
            sum_of_four(&mut residual_oe[m..][..n], odd_even);
            sum_of_four(&mut residual_eo[second..][..n], [even, even_below, odd, &odd[1..]]);
            let (west, above, here) =
                (&residual_oe[m - 1..], &residual_eo[first..], &residual_eo[second..]);
            let weights = around(&self.weights, o, grid.stride);
            sum_weighted(&mut restricted[..n], weights, [&west[1..], west, here, above]);
            scratch.split_restricted(&grid, &next.grid, &mut next.f, y);
        }
        self.scratch = scratch;
        unsettled
    }

    /// Counts the even-even cells that the coarse correction unsettles, of `n` places from `o`.
    ///
    /// Differences of u to the next even-even cell east and south form a gradient, and those of the
    /// correction its change. Their cross product gives the angle of the turn.
    #[inline(always)]
    fn unsettled(&self, o: usize, upper: &[R], lower: &[R], n: usize) -> usize {
        let stride = self.grid.stride;
        let flat = R::of(FLAT / self.grid.width.max(self.grid.height) as f64);
        let (flat, largest) = (flat * flat, R::of(LARGEST_CHANGE));
        let tolerance = R::of(TOLERANCE);
        let (c, c_east, c_south) = (&upper[..n], &upper[1..=n], &lower[..n]);
        let ee = &self.u[EE];
        let (u, east, south) = (&ee[o..][..n], &ee[o + 1..][..n], &ee[o + stride..][..n]);
        let half = R::of(0.5);
        let mut unsettled = 0_u32;
        for x in 0..n {
            let scale = u[x].inverse();
            let own = c[x] * scale;
            let (dx, dy) = (east[x] * scale - R::ONE, south[x] * scale - R::ONE);
            let (cx, cy) = (c_east[x] * scale - own, c_south[x] * scale - own);
            let square = dx * dx + dy * dy;
            let bound = if square > flat { square } else { flat };
            let turned = (dx * cy - dy * cx).size() > tolerance * bound;
            let reversed = dx * cx + dy * cy + half * bound < R::default();
            unsettled +=
                u32::from((turned | reversed | (own.size() > largest)) & (u[x] > R::default()));
        }
        unsettled as usize
    }

    #[inline(always)]
    fn relax(&mut self, plane: usize, strip: usize, mut change: Option<&mut [R]>) {
        let (o, n) = self.grid.strip(strip);
        let stride = self.grid.stride;
        let mut row = std::mem::take(&mut self.u[plane]);
        let [ee, oe, eo, oo] = &self.u;
        let [a, b, c, d] = match plane {
            EE => [&oe[o..], &oe[o - 1..], &eo[o..], &eo[o - stride..]],
            OE => [&ee[o..], &ee[o + 1..], &oo[o..], &oo[o - stride..]],
            EO => [&ee[o..], &ee[o + stride..], &oo[o..], &oo[o - 1..]],
            _ => [&oe[o..], &oe[o + stride..], &eo[o..], &eo[o + 1..]],
        };
        let around = [&a[..n], &b[..n], &c[..n], &d[..n]];
        let inverse = &self.inverse[plane][o..][..n];
        match change.as_deref_mut() {
            Some(change) => relax_noting(&mut row[o..][..n], inverse, around, &mut change[..n]),
            None => relax(&mut row[o..][..n], inverse, around),
        }
        self.u[plane] = row;
        let rows = self.grid.strip_rows;
        let rows = strip * rows..(strip + 1) * rows;
        let first =
            self.sources.partition_point(|source| (source.plane, source.row) < (plane, rows.start));
        for source in &self.sources[first..] {
            if source.plane != plane || source.row >= rows.end {
                break;
            }
            let inflow = self.inverse[plane][source.at] * source.value;
            self.u[plane][source.at] += inflow;
            if let Some(change) = change.as_deref_mut() {
                change[source.at - o] += inflow;
            }
        }
    }
}

#[inline(always)]
fn relax<R: Real>(u: &mut [R], inverse: &[R], [a, b, c, d]: [&[R]; 4]) {
    let n = u.len();
    first!(n, inverse, a, b, c, d);
    for x in 0..n {
        u[x] = (inverse[x] * ((a[x] + b[x]) + (c[x] + d[x]))).flushed();
    }
}

#[inline(always)]
fn relax_noting<R: Real>(u: &mut [R], inverse: &[R], [a, b, c, d]: [&[R]; 4], change: &mut [R]) {
    let n = u.len();
    first!(n, inverse, a, b, c, d);
    let change = &mut change[..n];
    for x in 0..n {
        let new = (inverse[x] * ((a[x] + b[x]) + (c[x] + d[x]))).flushed();
        change[x] = new - u[x];
        u[x] = new;
    }
}

#[inline(always)]
fn sum_of_four<R: Real>(out: &mut [R], [a, b, c, d]: [&[R]; 4]) {
    let n = out.len();
    first!(n, a, b, c, d);
    for x in 0..n {
        out[x] = (a[x] + b[x]) + (c[x] + d[x]);
    }
}

#[inline(always)]
fn sum_weighted<R: Real>(out: &mut [R], weights: [&[R]; 4], values: [&[R]; 4]) {
    let n = out.len();
    let ([s, t, v, w], [a, b, c, d]) = (weights, values);
    first!(n, s, t, v, w, a, b, c, d);
    for x in 0..n {
        out[x] = ((s[x] * a[x] + t[x] * b[x]) + (v[x] * c[x] + w[x] * d[x])).flushed();
    }
}
