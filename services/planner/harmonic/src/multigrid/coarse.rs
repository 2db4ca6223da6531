//! A coarser level: nine-point equations for the correction of the finer one, solved from a zero guess.
//!
//! The four planes are relaxed in turn. On the way down they start from zero, so each plane only sees those before it, and the residual
//! on a plane is the sum over the planes after it: neither the right-hand side nor the diagonal is read again. The odd-odd cells are
//! last on the way down, so their residual is zero, and first on the way up, so they need no correction. So no interpolation to them is
//! stored.

use super::grid::{
    EE, EO, Grid, MARGIN, OE, OO, Planes, Scratch, Weights, Whole, around, correct, cut, join,
    join_row, split, split_row,
};
use super::kernels::{add_active, gather, relax, subtract, sum_weighted};
use crate::real::Real;

/// The couplings stored with a cell: to its east, south, south-east and south-west neighbour. The others are those
/// neighbours' own.
pub(super) const EAST: usize = 0;
pub(super) const SOUTH: usize = 1;
pub(super) const SOUTH_EAST: usize = 2;
pub(super) const SOUTH_WEST: usize = 3;

const W: (isize, isize) = (-1, 0);
const E: (isize, isize) = (1, 0);
const N: (isize, isize) = (0, -1);
const S: (isize, isize) = (0, 1);
const NW: (isize, isize) = (-1, -1);
const NE: (isize, isize) = (1, -1);
const SW: (isize, isize) = (-1, 1);
const SE: (isize, isize) = (1, 1);
const ALL: [(isize, isize); 8] = [W, E, N, S, NW, NE, SW, SE];

#[derive(Debug, Default)]
pub(super) struct Coarse<R> {
    pub grid: Grid,
    pub u: Planes<R>,
    /// u of the first of two visits in a W-cycle, while the second solves for its residual.
    first_visit: Planes<R>,
    pub f: Planes<R>,
    /// 1 / diagonal, 0 where the cell is inactive.
    pub inverse: Planes<R>,
    /// Couplings (minus the matrix entries) by direction, then by plane.
    pub coupling: [Planes<R>; 4],
    pub weights: Weights<R>,
    scratch: Scratch<R>,
    whole: Whole<R>,
}

impl<R: Real> Coarse<R> {
    /// Makes this a level of `grid` without cells.
    pub(super) fn reshape(&mut self, grid: Grid) {
        self.grid = grid;
        let values = self.u.iter_mut().chain(&mut self.first_visit).chain(&mut self.f);
        let equations = self.inverse.iter_mut().chain(self.coupling.iter_mut().flatten());
        grid.reset(values.chain(equations).chain(&mut self.weights));
        self.whole.reset(&grid);
    }

    /// Relaxes from a zero guess and restricts the residual to `next`.
    #[inline(always)]
    pub(super) fn descend(&mut self, next: &mut Self) {
        if let Some(span) = self.grid.span() {
            return self.descend_whole(next, span);
        }
        let Grid { columns: n, rows, .. } = self.grid;
        let mut scratch = std::mem::take(&mut self.scratch);
        scratch.reset(&self.grid, &next.grid);
        let Scratch { residual_eo, residual_oe, residual_ee, restricted, .. } = &mut scratch;
        for y in 0..=rows {
            if y < rows {
                let o = self.grid.start(y);
                self.relax(EE, o, n, []);
                self.relax(OE, o, n, [W, E]);
            }
            if y == 0 {
                continue;
            }
            let y = y - 1;
            let o = self.grid.start(y);
            self.relax(EO, o, n, [N, S, NW, NE, SW, SE]);
            self.relax(OO, o, n, ALL);

            residual_eo.swap(0, 1);
            self.gather(EE, o, ALL, &mut residual_ee[MARGIN..][..n]);
            self.gather(OE, o, [N, S, NW, NE, SW, SE], &mut residual_oe[MARGIN..][..n]);
            self.gather(EO, o, [W, E], &mut residual_eo[1][MARGIN..][..n]);
            let residual_eo = (&residual_eo[0][MARGIN..][..n], &residual_eo[1][MARGIN..][..n]);
            let m = MARGIN;
            self.restrict(
                o,
                &residual_ee[m..],
                &residual_oe[m - 1..],
                residual_eo,
                &mut restricted[..n],
            );
            split_row(&next.grid, &mut next.f, y, restricted);
        }
        self.scratch = scratch;
    }

    /// [`descend`](Self::descend) for a small level, plane by plane, with `span` places of each.
    #[inline(always)]
    fn descend_whole(&mut self, next: &mut Self, span: usize) {
        let (o, stride) = (self.grid.start(0), self.grid.stride);
        let mut whole = std::mem::take(&mut self.whole);
        let Whole { transfer, residual_ee, residual_oe, residual_eo, .. } = &mut whole;
        self.relax(EE, o, span, []);
        self.relax(OE, o, span, [W, E]);
        self.relax(EO, o, span, [N, S, NW, NE, SW, SE]);
        self.relax(OO, o, span, ALL);
        self.gather(EE, o, ALL, &mut residual_ee[o..][..span]);
        self.gather(OE, o, [N, S, NW, NE, SW, SE], &mut residual_oe[o..][..span]);
        self.gather(EO, o, [W, E], &mut residual_eo[o..][..span]);
        self.restrict(
            o,
            &residual_ee[o..],
            &residual_oe[o - 1..],
            (&residual_eo[o - stride..], &residual_eo[o..]),
            &mut transfer[o..][..span],
        );
        split(&self.grid, &next.grid, &mut next.f, transfer);
        self.whole = whole;
    }

    /// Restricts residuals to as many cells of the next level from `o` on as `out` has. `odd_even` starts one cell to the west; the two
    /// rows of even-odd cells are that above and this one.
    #[inline(always)]
    fn restrict(
        &self,
        o: usize,
        even_even: &[R],
        odd_even: &[R],
        (above, here): (&[R], &[R]),
        out: &mut [R],
    ) {
        let weights = around(&self.weights, o, self.grid.stride);
        let around = [&odd_even[1..], odd_even, here, above];
        sum_weighted(out, &self.inverse[EE][o..], even_even, weights, around);
    }

    /// Adds `share` of the correction from `next` and relaxes.
    #[inline(always)]
    pub(super) fn ascend(&mut self, next: &Self, share: R) {
        if let Some(span) = self.grid.span() {
            return self.ascend_whole(next, share, span);
        }
        let Grid { columns: n, rows, .. } = self.grid;
        let mut scratch = std::mem::take(&mut self.scratch);
        let Scratch { upper, lower, .. } = &mut scratch;
        for row in [&mut *upper, &mut *lower] {
            row.clear();
            row.resize(2 * next.grid.columns + 2, R::default());
        }
        join_row(&next.grid, &next.u, 0, share, upper);
        for y in 0..=rows {
            if y < rows {
                join_row(&next.grid, &next.u, y + 1, share, lower);
                self.correct(self.grid.start(y), upper, lower, n);
                std::mem::swap(upper, lower);
            }
            if y > 0 {
                let o = self.grid.start(y - 1);
                for plane in [OO, EO, OE, EE] {
                    self.relax(plane, o, n, ALL);
                }
            }
        }
        self.scratch = scratch;
    }

    /// [`ascend`](Self::ascend) for a small level, plane by plane, with `span` places of each.
    #[inline(always)]
    fn ascend_whole(&mut self, next: &Self, share: R, span: usize) {
        let o = self.grid.start(0);
        let mut whole = std::mem::take(&mut self.whole);
        let transfer = &mut whole.transfer;
        join(&self.grid, &next.grid, &next.u, share, transfer);
        let below = &transfer[o + self.grid.stride..];
        self.correct(o, &transfer[o..], below, span);
        for plane in [OO, EO, OE, EE] {
            self.relax(plane, o, span, ALL);
        }
        self.whole = whole;
    }

    /// Adds the correction to `n` cells from `o` on of each plane but the odd-odd one.
    #[inline(always)]
    fn correct(&mut self, o: usize, upper: &[R], lower: &[R], n: usize) {
        add_active(&mut self.u[EE][o..][..n], &self.inverse[EE][o..], upper);
        correct(&mut self.u, &self.weights, (upper, lower), o, n);
    }

    /// Keeps u of the first visit and makes its residual the right-hand side of the second.
    #[inline(always)]
    pub(super) fn begin_second_visit(&mut self) {
        let (n, rows) = match self.grid.span() {
            Some(span) => (span, 1),
            None => (self.grid.columns, self.grid.rows),
        };
        for plane in [EE, OE, EO, OO] {
            for y in 0..rows {
                let o = self.grid.start(y);
                let mut f = std::mem::take(&mut self.f[plane]);
                let terms = self.terms(plane, o, n, ALL);
                let (u, inverse) = (&self.u[plane][o..][..n], &self.inverse[plane][o..][..n]);
                subtract(&mut f[o..][..n], u, inverse, &terms);
                self.f[plane] = f;
            }
        }
        // The next descent starts from zero and overwrites all of u.
        std::mem::swap(&mut self.first_visit, &mut self.u);
    }

    pub(super) fn end_second_visit(&mut self) {
        for (u, first) in self.u.iter_mut().zip(&self.first_visit) {
            for (u, &first) in u.iter_mut().zip(first) {
                *u += first;
            }
        }
    }

    /// u = (f + couplings times u of the neighbours at `steps`) / diagonal, for the `n` places of a plane from `o` on.
    #[inline(always)]
    fn relax<const COUNT: usize>(
        &mut self,
        plane: usize,
        o: usize,
        n: usize,
        steps: [(isize, isize); COUNT],
    ) {
        let mut row = std::mem::take(&mut self.u[plane]);
        let terms = self.terms(plane, o, n, steps);
        let f = &self.f[plane][o..][..n];
        let inverse = &self.inverse[plane][o..][..n];
        relax(&mut row[o..][..n], f, inverse, &terms);
        self.u[plane] = row;
    }

    /// The sum of couplings times u over the neighbours at `steps`, for as many places of a plane from `o` on as `into` has.
    #[inline(always)]
    fn gather<const COUNT: usize>(
        &self,
        plane: usize,
        o: usize,
        steps: [(isize, isize); COUNT],
        into: &mut [R],
    ) {
        let terms = self.terms(plane, o, into.len(), steps);
        gather(into, &terms);
    }

    #[inline(always)]
    fn terms<const COUNT: usize>(
        &self,
        plane: usize,
        o: usize,
        n: usize,
        steps: [(isize, isize); COUNT],
    ) -> [(&[R], &[R]); COUNT] {
        // This is a plain loop because `map` is not always inlined, and the loop runs for every row.
        let mut terms: [(&[R], &[R]); COUNT] = [(&[], &[]); COUNT];
        for (term, &step) in terms.iter_mut().zip(&steps) {
            *term = self.term(plane, o, n, step);
        }
        terms
    }

    #[inline(always)]
    fn term(&self, plane: usize, o: usize, n: usize, step: (isize, isize)) -> (&[R], &[R]) {
        let (there, at) = neighbour(&self.grid, plane, o, step);
        let here = step.1 > 0 || step == E;
        let (owner, from) = if here { (plane, o) } else { (there, at) };
        let direction = match step {
            E | W => EAST,
            S | N => SOUTH,
            SE | NW => SOUTH_EAST,
            _ => SOUTH_WEST,
        };
        (&self.coupling[direction][owner][from..][..n], &self.u[there][at..][..n])
    }

    /// The weights of the odd-odd cell at `at` on the four coarse cells around it, in the order of the finest level.
    pub(super) fn corner_weights(&self, at: usize) -> [R; 4] {
        let a = |step| self.term(OO, at, 1, step).0[0];
        let m = self.inverse[OO][at];
        let below = at + self.grid.stride;
        let [west, east, north, south] = &self.weights;
        [
            m * (a(NW) + a(N) * west[at] + a(W) * north[at]),
            m * (a(NE) + a(N) * east[at] + a(E) * north[at + 1]),
            m * (a(SW) + a(S) * west[below] + a(W) * south[at]),
            m * (a(SE) + a(S) * east[below] + a(E) * south[at + 1]),
        ]
    }

    /// Interpolation along the lines between coarse cells: the couplings across the line are added to those along it,
    /// those straight across are taken off the diagonal.
    ///
    /// A coarse cell gives only to cells coupled to it. If a wall lies between them, or the coarse cell is itself a wall, the couplings
    /// to cells beside it would couple the corrections on both sides of the wall, and far from the target the cycles would not
    /// converge.
    #[inline(always)]
    pub(super) fn interpolate(&mut self, rows: std::ops::Range<usize>) {
        let Grid { columns: n, stride: s, .. } = self.grid;
        let [right, down, down_right, down_left] = &self.coupling;
        let least = R::of(1e-4);
        let share = |d: R, a: R, b: R| {
            let rest = d - a - b;
            if rest > least * d { R::ONE / rest } else { R::default() }
        };
        for y in rows {
            let o = self.grid.start(y);
            let [to_west, to_east, to_north, to_south] = &mut self.weights;
            cut!(o, n, to_west, to_east, to_north, to_south);
            let own = &self.inverse[OE][o..][..n];
            let (w, nw, sw) =
                (&right[EE][o..][..n], &down_right[EO][o - s..][..n], &down_left[OE][o..][..n]);
            let (e, ne, se) =
                (&right[OE][o..][..n], &down_left[EO][o + 1 - s..][..n], &down_right[OE][o..][..n]);
            let (no, so) = (&down[OO][o - s..][..n], &down[OE][o..][..n]);
            for x in 0..n {
                let share = share(own[x].inverse(), no[x], so[x]);
                to_west[x] = w[x].is_active() * (w[x] + nw[x] + sw[x]) * share;
                to_east[x] = e[x].is_active() * (e[x] + ne[x] + se[x]) * share;
            }
            let own = &self.inverse[EO][o..][..n];
            let (no, nw, ne) =
                (&down[EE][o..][..n], &down_right[OE][o - 1..][..n], &down_left[OE][o..][..n]);
            let (so, sw, se) =
                (&down[EO][o..][..n], &down_left[EO][o..][..n], &down_right[EO][o..][..n]);
            let (w, e) = (&right[OO][o - 1..][..n], &right[EO][o..][..n]);
            for x in 0..n {
                let share = share(own[x].inverse(), w[x], e[x]);
                to_north[x] = no[x].is_active() * (no[x] + nw[x] + ne[x]) * share;
                to_south[x] = so[x].is_active() * (so[x] + sw[x] + se[x]) * share;
            }
        }
    }
}

#[inline(always)]
fn neighbour(grid: &Grid, plane: usize, at: usize, (dx, dy): (isize, isize)) -> (usize, usize) {
    let (x, y) = ((plane & 1) as isize + dx, (plane >> 1) as isize + dy);
    let there = (x.rem_euclid(2) + 2 * y.rem_euclid(2)) as usize;
    let offset = y.div_euclid(2) * grid.stride as isize + x.div_euclid(2);
    (there, at.wrapping_add_signed(offset))
}
