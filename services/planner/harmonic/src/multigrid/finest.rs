//! The finest level: the five-point equation itself.
//!
//! Even-even and odd-odd cells are red, the others black; red cells have black neighbours alone and the reverse. One pass
//! over the rows does all of the level's work between two visits to the coarser ones, so the level is read from memory
//! once a cycle: the coarse correction goes to the black cells, red is relaxed from black (and needs no correction of its
//! own), black from red, then red again. The changes of that last half sweep, summed over the red neighbours of a black cell,
//! are exactly its residual, which is restricted at once.

use std::ops::Range;

use super::coarse::Coarse;
use super::grid::{
    EE, EO, Grid, MARGIN, OE, OO, Planes, Scratch, Weights, Whole, around, correct, cut, join,
    join_row, split, split_row,
};
use crate::real::Real;

/// An inflow at one cell: the right-hand side of its equation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source<R> {
    pub plane: usize,
    pub row: usize,
    pub at: usize,
    pub value: R,
}

/// Relative change of u by a coarse correction above which a cell has not settled, whatever its direction.
const LARGEST_CHANGE: f64 = 0.05;

/// Changes of u over two cells, relative to u, times the map's longer side, below which a cell lies at a saddle point: there
/// the tolerance is that of a cell with a change as large as this.
const FLAT: f64 = 0.5;

#[derive(Debug, Default)]
pub(super) struct Finest<R> {
    pub grid: Grid,
    pub u: Planes<R>,
    /// 1 / diagonal, 0 where blocked.
    pub inverse: Planes<R>,
    pub weights: Weights<R>,
    /// The sources, sorted by plane and row.
    pub sources: Vec<Source<R>>,
    scratch: Scratch<R>,
    whole: Whole<R>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Work<R> {
    /// The factor of the correction from the next level.
    pub share: R,
    /// Full sweeps after the correction.
    pub sweeps: usize,
    /// Whether a half sweep follows whose changes are restricted to the next level as the residual.
    pub descend: bool,
    /// The angle, radians, beyond which a cell whose direction the correction turns counts as unsettled; none for no such
    /// check.
    pub tolerance: Option<R>,
}

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Progress {
    /// Even-even cells whose direction the coarse correction turned by more than the tolerance, or whose u it changed
    /// by more than [`LARGEST_CHANGE`].
    pub unsettled: usize,
}

impl<R: Real> Finest<R> {
    /// Makes this a level of `grid` without cells.
    pub(super) fn reshape(&mut self, grid: Grid) {
        self.grid = grid;
        grid.reset(self.u.iter_mut().chain(&mut self.inverse).chain(&mut self.weights));
        self.sources.clear();
        self.whole.reset(&grid);
    }

    /// Sets one row of cells; `inverse` gives 1 / diagonal of a free cell by its column.
    #[inline(always)]
    pub(super) fn set_row(&mut self, row: usize, blocked: &[bool], inverse: impl Fn(usize) -> R) {
        let Grid { width, columns, .. } = self.grid;
        let (plane, start) = self.grid.locate(0, row);
        let (first, second) = self.inverse.split_at_mut(plane + 1);
        let even = &mut first[plane][start..][..columns];
        let odd = &mut second[0][start..][..columns];
        let value = |col: usize| {
            if blocked[col] { R::default() } else { inverse(col) }
        };
        for x in 0..width / 2 {
            even[x] = value(2 * x);
            odd[x] = value(2 * x + 1);
        }
        if width % 2 == 1 {
            even[columns - 1] = value(width - 1);
        }
    }

    /// Interpolation by the equation itself: an odd-even cell takes its neighbours to the north and south to be its
    /// equals, which leaves those to the west and east. Blocked cells give and take nothing.
    #[inline(always)]
    pub(super) fn interpolate_rows(&mut self, rows: Range<usize>) {
        let Grid { columns: n, stride, .. } = self.grid;
        let least = R::of(1e-4);
        for row in rows {
            let o = self.grid.start(row);
            let of = |plane: usize, start: usize| &self.inverse[plane][start..start + n];
            let [to_west, to_east, to_north, to_south] = &mut self.weights;
            cut!(o, n, to_west, to_east, to_north, to_south);
            let weights = |d: R, a: R, b: R| {
                let rest = d - a.is_active() - b.is_active();
                if rest > least * d { R::ONE / rest } else { R::default() }
            };
            let (own, west, east, north, south) =
                (of(OE, o), of(EE, o), of(EE, o + 1), of(OO, o - stride), of(OO, o));
            for x in 0..n {
                let weight = weights(own[x].inverse(), north[x], south[x]);
                to_west[x] = west[x].is_active() * weight;
                to_east[x] = east[x].is_active() * weight;
            }
            let (own, north, south, west, east) =
                (of(EO, o), of(EE, o), of(EE, o + stride), of(OO, o - 1), of(OO, o));
            for x in 0..n {
                let weight = weights(own[x].inverse(), west[x], east[x]);
                to_north[x] = north[x].is_active() * weight;
                to_south[x] = south[x].is_active() * weight;
            }
        }
    }

    /// The weights of the odd-odd cell at `at` on the coarse cells north-west, north-east, south-west and south-east of
    /// it: its own equation, with its neighbours interpolated.
    pub(super) fn corner_weights(&self, at: usize) -> [R; 4] {
        let m = self.inverse[OO][at];
        let below = at + self.grid.stride;
        let [west, east, north, south] = &self.weights;
        [
            m * (west[at] + north[at]),
            m * (east[at] + north[at + 1]),
            m * (west[below] + south[at]),
            m * (east[below] + south[at + 1]),
        ]
    }

    /// A pass over the level: correction from `next`, sweeps, and residual.
    #[inline(always)]
    pub(super) fn pass(&mut self, next: &mut Coarse<R>, work: Work<R>) -> Progress {
        if let Some(span) = self.grid.span() {
            return self.pass_whole(next, work, span);
        }
        let Work { share, sweeps, descend, tolerance } = work;
        let Grid { columns: n, rows, .. } = self.grid;
        let grid = self.grid;
        let mut progress = Progress::default();
        let mut scratch = std::mem::take(&mut self.scratch);
        scratch.reset(&grid, &next.grid);
        let Scratch {
            upper,
            lower,
            restricted,
            change_ee,
            change_oo,
            residual_eo,
            residual_oe,
            ..
        } = &mut scratch;
        join_row(&next.grid, &next.u, 0, share, upper);

        for y in 0..rows + sweeps + 2 {
            if y < rows {
                join_row(&next.grid, &next.u, y + 1, share, lower);
                if let Some(tolerance) = tolerance {
                    progress.unsettled +=
                        self.unsettled(self.grid.start(y), upper, lower, tolerance, n);
                }
                correct(&mut self.u, &self.weights, (upper, lower), grid.start(y), n);
                std::mem::swap(upper, lower);
            }
            // Every sweep follows the one before at a distance of one row.
            for sweep in 0..sweeps {
                if (sweep..rows + sweep).contains(&y) {
                    self.relax(EE, y - sweep, None);
                }
                if (sweep + 1..=rows + sweep).contains(&y) {
                    for plane in [OO, OE, EO] {
                        self.relax(plane, y - sweep - 1, None);
                    }
                }
            }
            if !descend || y < sweeps {
                continue;
            }
            let y = y - sweeps;
            // The margin beyond the last row does not change.
            change_ee.swap(0, 1);
            change_oo.swap(0, 1);
            if y < rows {
                self.relax(EE, y, Some(&mut change_ee[1]));
            } else {
                change_ee[1].fill(R::default());
            }
            if (1..=rows).contains(&y) {
                let y = y - 1;
                self.relax(OO, y, Some(&mut change_oo[1]));
                residual_eo.swap(0, 1);
                let [above, here] = &mut *residual_eo;
                let m = MARGIN;
                residual_on_black(
                    [&change_ee[0], &change_ee[1]].map(|row| &row[m..]),
                    [&change_oo[0], &change_oo[1]].map(|row| &row[m - 1..]),
                    &mut residual_oe[m..][..n],
                    &mut here[m..][..n],
                );
                self.restrict(
                    grid.start(y),
                    &residual_oe[m - 1..],
                    (&above[m..], &here[m..]),
                    &mut restricted[..n],
                );
                split_row(&next.grid, &mut next.f, y, restricted);
            }
        }
        self.scratch = scratch;
        progress
    }

    /// [`pass`](Self::pass) for a small level, plane by plane, with `span` places of each.
    #[inline(always)]
    fn pass_whole(&mut self, next: &mut Coarse<R>, work: Work<R>, span: usize) -> Progress {
        let grid = self.grid;
        let (o, stride) = (grid.start(0), grid.stride);
        let mut whole = std::mem::take(&mut self.whole);
        let Whole { transfer, change_ee, change_oo, residual_oe, residual_eo, .. } = &mut whole;
        let mut progress = Progress::default();
        join(&grid, &next.grid, &next.u, work.share, transfer);
        let (upper, lower) = (&transfer[o..], &transfer[o + stride..]);
        if let Some(tolerance) = work.tolerance {
            progress.unsettled = self.unsettled(o, upper, lower, tolerance, span);
        }
        correct(&mut self.u, &self.weights, (upper, lower), o, span);
        for _ in 0..work.sweeps {
            for plane in [EE, OO, OE, EO] {
                self.relax_places(plane, o, span, None);
                self.add_sources(plane, 0..grid.rows, 0, None);
            }
        }
        if work.descend {
            for (plane, change) in [(EE, &mut *change_ee), (OO, &mut *change_oo)] {
                self.relax_places(plane, o, span, Some(&mut change[o..]));
                self.add_sources(plane, 0..grid.rows, 0, Some(change));
            }
            residual_on_black(
                [&change_ee[o..], &change_ee[o + stride..]],
                [&change_oo[o - stride - 1..], &change_oo[o - 1..]],
                &mut residual_oe[o..][..span],
                &mut residual_eo[o..][..span],
            );
            self.restrict(
                o,
                &residual_oe[o - 1..],
                (&residual_eo[o - stride..], &residual_eo[o..]),
                &mut transfer[o..][..span],
            );
            split(&grid, &next.grid, &mut next.f, transfer);
        }
        self.whole = whole;
        progress
    }

    /// Counts the even-even cells that the coarse correction unsettles, of `n` places from `o` on.
    ///
    /// The differences of u to the next even-even cell east and south are those of one gradient. The correction's differences
    /// are the change of the gradient, so the cross product of both is the angle by which the correction turns it.
    #[inline(always)]
    fn unsettled(&self, o: usize, upper: &[R], lower: &[R], tolerance: R, n: usize) -> usize {
        let stride = self.grid.stride;
        let flat = R::of(FLAT / self.grid.width.max(self.grid.height) as f64);
        let (flat, largest) = (flat * flat, R::of(LARGEST_CHANGE));
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

    /// Restricts the residuals of black cells to as many coarse cells from `o` on as `out` has. `odd_even` starts one cell to
    /// the west; the two rows of even-odd cells are that above and this one.
    #[inline(always)]
    fn restrict(&self, o: usize, odd_even: &[R], (above, here): (&[R], &[R]), out: &mut [R]) {
        let weights = around(&self.weights, o, self.grid.stride);
        sum_weighted(out, weights, [&odd_even[1..], odd_even, here, above]);
    }

    /// Relaxes row `y` of a plane from its four neighbours; `change`, if given, takes the change of each cell.
    #[inline(always)]
    fn relax(&mut self, plane: usize, y: usize, mut change: Option<&mut [R]>) {
        let o = self.grid.start(y);
        let noted = change.as_deref_mut().map(|change| &mut change[MARGIN..]);
        self.relax_places(plane, o, self.grid.columns, noted);
        self.add_sources(plane, y..y + 1, o - MARGIN, change);
    }

    /// Relaxes `n` places of a plane from `o` on, without sources.
    #[inline(always)]
    fn relax_places(&mut self, plane: usize, o: usize, n: usize, change: Option<&mut [R]>) {
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
        match change {
            Some(change) => relax_noting(&mut row[o..][..n], inverse, around, &mut change[..n]),
            None => relax(&mut row[o..][..n], inverse, around),
        }
        self.u[plane] = row;
    }

    /// Adds the inflow of the cells in `rows` of a plane to u and to its noted change, which starts at place `origin`.
    #[inline(always)]
    fn add_sources(
        &mut self,
        plane: usize,
        rows: Range<usize>,
        origin: usize,
        mut change: Option<&mut [R]>,
    ) {
        let first =
            self.sources.partition_point(|source| (source.plane, source.row) < (plane, rows.start));
        for source in &self.sources[first..] {
            if source.plane != plane || source.row >= rows.end {
                break;
            }
            let inflow = self.inverse[plane][source.at] * source.value;
            self.u[plane][source.at] += inflow;
            if let Some(change) = change.as_deref_mut() {
                change[source.at - origin] += inflow;
            }
        }
    }
}

#[inline(always)]
fn relax<R: Real>(u: &mut [R], inverse: &[R], [a, b, c, d]: [&[R]; 4]) {
    let n = u.len();
    let (inverse, a, b, c, d) = (&inverse[..n], &a[..n], &b[..n], &c[..n], &d[..n]);
    for x in 0..n {
        u[x] = (inverse[x] * ((a[x] + b[x]) + (c[x] + d[x]))).flushed();
    }
}

#[inline(always)]
fn relax_noting<R: Real>(u: &mut [R], inverse: &[R], [a, b, c, d]: [&[R]; 4], change: &mut [R]) {
    let n = u.len();
    let (inverse, a, b, c, d) = (&inverse[..n], &a[..n], &b[..n], &c[..n], &d[..n]);
    let change = &mut change[..n];
    for x in 0..n {
        let new = (inverse[x] * ((a[x] + b[x]) + (c[x] + d[x]))).flushed();
        change[x] = new - u[x];
        u[x] = new;
    }
}

/// The residual of black cells, as many as the outputs have: the sum of the changes of their red neighbours. Blocked cells get
/// one too; their interpolation weights are zero. The changes of even-even cells are those here and a row below, those of
/// odd-odd cells a row above and here, from one cell to the west on.
#[inline(always)]
fn residual_on_black<R: Real>(
    [even, even_below]: [&[R]; 2],
    [odd_above, odd]: [&[R]; 2],
    odd_even: &mut [R],
    even_odd: &mut [R],
) {
    sum_of_four(odd_even, [even, &even[1..], &odd_above[1..], &odd[1..]]);
    sum_of_four(even_odd, [even, even_below, odd, &odd[1..]]);
}

#[inline(always)]
fn sum_of_four<R: Real>(out: &mut [R], [a, b, c, d]: [&[R]; 4]) {
    let n = out.len();
    let (a, b, c, d) = (&a[..n], &b[..n], &c[..n], &d[..n]);
    for x in 0..n {
        out[x] = (a[x] + b[x]) + (c[x] + d[x]);
    }
}

#[inline(always)]
fn sum_weighted<R: Real>(out: &mut [R], weights: [&[R]; 4], values: [&[R]; 4]) {
    let n = out.len();
    let [s, t, v, w] = weights.map(|it| &it[..n]);
    let [a, b, c, d] = values.map(|it| &it[..n]);
    for x in 0..n {
        out[x] = ((s[x] * a[x] + t[x] * b[x]) + (v[x] * c[x] + w[x] * d[x])).flushed();
    }
}
