//! The equations of a coarser level: interpolation transposed times the finer equations times interpolation.
//!
//! The interpolation to an odd-odd cell satisfies that cell's own equation, so the product of the equations and the
//! interpolation vanishes there: only the rows of the even-even, odd-even and even-odd cells are formed, one row of cells
//! at a time, and added up with their weights on the coarse cell.
//!
//! The finest level has a product of its own, because its couplings are 0 or 1 and it has no diagonal ones. A common loop for all
//! levels takes 30 % longer for the whole set-up, and a loop for each term 7 % longer.

use std::ops::Range;

use super::coarse::{Coarse, EAST, SOUTH, SOUTH_EAST, SOUTH_WEST};
use super::finest::Finest;
use super::grid::{EE, EO, Grid, MARGIN, OE, OO, cut, split_row};
use crate::real::Real;

/// Columns of a product row by the coarse cell they belong to. Around an odd-even cell these are west, east and the
/// two north and south of each; around an even-odd cell north, south and the two west and east of each.
const FIRST: usize = 0;
const SECOND: usize = 1;
const NORTH_EAST: usize = 3;
const BELOW_WEST: usize = 4;
const BELOW_EAST: usize = 5;

type Rows<R, const COUNT: usize> = [Vec<R>; COUNT];

/// Rows under way from a fine level to the next, reused between set-ups.
#[derive(Debug)]
pub(super) struct Products<R> {
    n: usize,
    /// Interpolation weights of the odd-odd cells of the row above and of this row.
    corner: [Rows<R, 4>; 2],
    /// Product rows of the odd-even cells of this row.
    odd_even: Rows<R, 6>,
    /// Product rows of the even-odd cells of the row above and of this row.
    even_odd: [Rows<R, 6>; 2],
    /// Even-even products: diagonal, then the four stored directions.
    even_even: Rows<R, 5>,
    /// Coarse rows: diagonal, then couplings.
    out: Rows<R, 5>,
}
#[inline(always)]
fn places<R, const COUNT: usize>(rows: &Rows<R, COUNT>, start: usize, n: usize) -> [&[R]; COUNT] {
    let mut slices: [&[R]; COUNT] = [&[]; COUNT];
    for (slice, row) in slices.iter_mut().zip(rows) {
        *slice = &row[start..][..n];
    }
    slices
}

impl<R: Real> Products<R> {
    pub(super) fn new(grid: &Grid) -> Self {
        fn rows<R: Real, const COUNT: usize>(grid: &Grid) -> Rows<R, COUNT> {
            std::array::from_fn(|_| vec![R::default(); grid.stride + MARGIN])
        }
        Self {
            n: grid.columns,
            corner: [rows(grid), rows(grid)],
            odd_even: rows(grid),
            even_odd: [rows(grid), rows(grid)],
            even_even: rows(grid),
            out: rows(grid),
        }
    }

    fn start(&mut self) {
        let [_, corner] = &mut self.corner;
        let [_, even_odd] = &mut self.even_odd;
        for row in corner.iter_mut().chain(even_odd) {
            row.fill(R::default());
        }
    }

    fn next_row(&mut self) {
        self.corner.swap(0, 1);
        self.even_odd.swap(0, 1);
    }

    /// Adds up row `y` of the coarse equations, with the weights of the cells around its cells, and stores it in `next`.
    #[inline(always)]
    fn finish_row(
        &mut self,
        [west, east, north, south]: [&[R]; 4],
        next: &mut Coarse<R>,
        y: usize,
    ) {
        let n = self.n;
        let q = |column: usize| &self.odd_even[column][MARGIN..][..n];
        let q_west = |column: usize| &self.odd_even[column][MARGIN - 1..][..n];
        let v = |column: usize| &self.even_odd[1][column][MARGIN..][..n];
        let v_above = |column: usize| &self.even_odd[0][column][MARGIN..][..n];
        let own = |k: usize| &self.even_even[k][MARGIN..][..n];
        let [diagonal, right, down, down_right, down_left] = &mut self.out;

        let (e0, a, b, c, d) = (own(0), q(FIRST), q_west(SECOND), v(FIRST), v_above(SECOND));
        for (x, out) in diagonal[..n].iter_mut().enumerate() {
            let sum = e0[x] + west[x] * a[x] + east[x] * b[x] + north[x] * c[x] + south[x] * d[x];
            *out = if e0[x] > R::default() { sum } else { R::default() };
        }
        let (e1, a, c, d) = (own(1), q(SECOND), v(NORTH_EAST), v_above(BELOW_EAST));
        for (x, out) in right[..n].iter_mut().enumerate() {
            *out = R::default() - (e1[x] + west[x] * a[x] + north[x] * c[x] + south[x] * d[x]);
        }
        let (e2, a, b, c) = (own(2), q(BELOW_WEST), q_west(BELOW_EAST), v(SECOND));
        for (x, out) in down[..n].iter_mut().enumerate() {
            *out = R::default() - (e2[x] + west[x] * a[x] + east[x] * b[x] + north[x] * c[x]);
        }
        let (e3, a, c) = (own(3), q(BELOW_EAST), v(BELOW_EAST));
        for (x, out) in down_right[..n].iter_mut().enumerate() {
            *out = R::default() - (e3[x] + west[x] * a[x] + north[x] * c[x]);
        }
        let (e4, b, c) = (own(4), q_west(BELOW_WEST), v(BELOW_WEST));
        for (x, out) in down_left[..n].iter_mut().enumerate() {
            *out = R::default() - (e4[x] + east[x] * b[x] + north[x] * c[x]);
        }
        for out in diagonal[..n].iter_mut() {
            *out = out.inverse();
        }
        split_row(&next.grid, &mut next.inverse, y, diagonal);
        for (coupling, row) in next.coupling.iter_mut().zip([right, down, down_right, down_left]) {
            split_row(&next.grid, coupling, y, row);
        }
    }
}

impl<R: Real> Finest<R> {
    /// Sets `rows` of the equations of `next`.
    #[inline(always)]
    pub(super) fn coarsen(
        &self,
        next: &mut Coarse<R>,
        rows: Range<usize>,
        products: &mut Products<R>,
    ) {
        let Grid { columns: n, stride: s, .. } = self.grid;
        products.start();
        let zero = R::default();
        let [west, east, north, south] = &self.weights;
        let we = |at: usize| [&west[at..][..n], &east[at..][..n]];
        let ns = |at: usize| [&north[at..][..n], &south[at..][..n]];
        // The row before the first is included, because its contribution belongs to the first row.
        for y in rows.start.saturating_sub(1)..rows.end {
            products.next_row();
            let o = self.grid.start(y);
            let m = MARGIN;
            let ([w, e], [no, so]) = (we(o), ns(o));
            let ([w_below, e_below], [no_east, so_east]) = (we(o + s), ns(o + 1));

            let [nw, ne, sw, se] = &mut products.corner[1];
            cut!(m, n, nw, ne, sw, se);
            let inverse = &self.inverse[OO][o..][..n];
            for x in 0..n {
                nw[x] = inverse[x] * (w[x] + no[x]);
                ne[x] = inverse[x] * (e[x] + no_east[x]);
                sw[x] = inverse[x] * (w_below[x] + so[x]);
                se[x] = inverse[x] * (e_below[x] + so_east[x]);
            }

            let (e_west, s_above) = (&east[o - 1..][..n], &south[o - s..][..n]);
            let [above, here] = &products.corner;
            let active = &self.inverse[EE][o..][..n];
            let active_east = &self.inverse[EE][o + 1..][..n];
            let active_south = &self.inverse[EE][o + s..][..n];
            {
                let d = &self.inverse[OE][o..][..n];
                let [a_nw, a_ne, a_sw, a_se] = places(above, m, n);
                let [h_nw, h_ne, h_sw, h_se] = places(here, m, n);
                let [q0, q1, q2, q3, q4, q5] = &mut products.odd_even;
                cut!(m, n, q0, q1, q2, q3, q4, q5);
                for x in 0..n {
                    let d = d[x].inverse();
                    q0[x] = d * w[x] - active[x].is_active() - a_sw[x] - h_nw[x];
                    q1[x] = d * e[x] - active_east[x].is_active() - a_se[x] - h_ne[x];
                }
                for x in 0..n {
                    q2[x] = zero - a_nw[x];
                    q3[x] = zero - a_ne[x];
                    q4[x] = zero - h_sw[x];
                    q5[x] = zero - h_se[x];
                }
            }
            {
                let d = &self.inverse[EO][o..][..n];
                let [h_nw, h_ne, h_sw, h_se] = places(here, m, n);
                let [l_nw, l_ne, l_sw, l_se] = places(here, m - 1, n);
                let [v0, v1, v2, v3, v4, v5] = &mut products.even_odd[1];
                cut!(m, n, v0, v1, v2, v3, v4, v5);
                for x in 0..n {
                    let d = d[x].inverse();
                    v0[x] = d * no[x] - active[x].is_active() - l_ne[x] - h_nw[x];
                    v1[x] = d * so[x] - active_south[x].is_active() - l_se[x] - h_sw[x];
                }
                for x in 0..n {
                    v2[x] = zero - l_nw[x];
                    v3[x] = zero - h_ne[x];
                    v4[x] = zero - l_sw[x];
                    v5[x] = zero - h_se[x];
                }
            }
            {
                let [p0, p1, p2, p3, p4] = &mut products.even_even;
                cut!(m, n, p0, p1, p2, p3, p4);
                for x in 0..n {
                    let on = active[x].is_active();
                    p0[x] = active[x].inverse() - on * (w[x] + e_west[x] + no[x] + s_above[x]);
                    p1[x] = zero - on * e[x];
                    p2[x] = zero - on * so[x];
                }
                p3.fill(zero);
                p4.fill(zero);
            }
            if y >= rows.start {
                products.finish_row([w, e_west, no, s_above], next, y);
            }
        }
    }
}

impl<R: Real> Coarse<R> {
    /// Sets `rows` of the equations of `next`.
    #[inline(always)]
    pub(super) fn coarsen(&self, next: &mut Self, rows: Range<usize>, products: &mut Products<R>) {
        let Grid { columns: n, stride: s, .. } = self.grid;
        products.start();
        let zero = R::default();
        let m = MARGIN;
        let a = |direction: usize, plane: usize, start: usize| {
            &self.coupling[direction][plane][start..][..n]
        };
        let [west, east, north, south] = &self.weights;
        let we = |at: usize| [&west[at..][..n], &east[at..][..n]];
        let ns = |at: usize| [&north[at..][..n], &south[at..][..n]];
        // The row before the first is included, because its contribution belongs to the first row.
        for y in rows.start.saturating_sub(1)..rows.end {
            products.next_row();
            let o = self.grid.start(y);
            let ([w, e], [no, so], [no_east, so_east]) = (we(o), ns(o), ns(o + 1));
            let ([w_west, e_west], [w_below, e_below]) = (we(o - 1), we(o + s));
            let [w_below_west, e_below_west] = we(o + s - 1);
            let ([no_above, so_above], [no_above_east, so_above_east]) = (ns(o - s), ns(o - s + 1));

            {
                let [nw, ne, sw, se] = &mut products.corner[1];
                cut!(m, n, nw, ne, sw, se);
                let inverse = &self.inverse[OO][o..][..n];
                let (up, down) = (a(SOUTH, OE, o), a(SOUTH, OO, o));
                let (left, right) = (a(EAST, EO, o), a(EAST, OO, o));
                let (c_nw, c_ne) = (a(SOUTH_EAST, EE, o), a(SOUTH_WEST, EE, o + 1));
                let (c_sw, c_se) = (a(SOUTH_WEST, OO, o), a(SOUTH_EAST, OO, o));
                for x in 0..n {
                    nw[x] = inverse[x] * (c_nw[x] + up[x] * w[x] + left[x] * no[x]);
                    ne[x] = inverse[x] * (c_ne[x] + up[x] * e[x] + right[x] * no_east[x]);
                }
                for x in 0..n {
                    sw[x] = inverse[x] * (c_sw[x] + down[x] * w_below[x] + left[x] * so[x]);
                    se[x] = inverse[x] * (c_se[x] + down[x] * e_below[x] + right[x] * so_east[x]);
                }
            }
            let [above, here] = &products.corner;
            {
                let inverse = &self.inverse[OE][o..][..n];
                let (left, right) = (a(EAST, EE, o), a(EAST, OE, o));
                let (up, down) = (a(SOUTH, OO, o - s), a(SOUTH, OE, o));
                let (c_nw, c_ne) = (a(SOUTH_EAST, EO, o - s), a(SOUTH_WEST, EO, o - s + 1));
                let (c_sw, c_se) = (a(SOUTH_WEST, OE, o), a(SOUTH_EAST, OE, o));
                let [a_nw, a_ne, a_sw, a_se] = places(above, m, n);
                let [h_nw, h_ne, h_sw, h_se] = places(here, m, n);
                let [q0, q1, q2, q3, q4, q5] = &mut products.odd_even;
                cut!(m, n, q0, q1, q2, q3, q4, q5);
                for x in 0..n {
                    let d = inverse[x].inverse();
                    q0[x] = d * w[x]
                        - left[x]
                        - up[x] * a_sw[x]
                        - down[x] * h_nw[x]
                        - c_nw[x] * so_above[x]
                        - c_sw[x] * no[x];
                    q1[x] = d * e[x]
                        - right[x]
                        - up[x] * a_se[x]
                        - down[x] * h_ne[x]
                        - c_ne[x] * so_above_east[x]
                        - c_se[x] * no_east[x];
                }
                for x in 0..n {
                    q2[x] = zero - up[x] * a_nw[x] - c_nw[x] * no_above[x];
                    q3[x] = zero - up[x] * a_ne[x] - c_ne[x] * no_above_east[x];
                    q4[x] = zero - down[x] * h_sw[x] - c_sw[x] * so[x];
                    q5[x] = zero - down[x] * h_se[x] - c_se[x] * so_east[x];
                }
            }
            {
                let inverse = &self.inverse[EO][o..][..n];
                let (up, down) = (a(SOUTH, EE, o), a(SOUTH, EO, o));
                let (left, right) = (a(EAST, OO, o - 1), a(EAST, EO, o));
                let (c_nw, c_ne) = (a(SOUTH_EAST, OE, o - 1), a(SOUTH_WEST, OE, o));
                let (c_sw, c_se) = (a(SOUTH_WEST, EO, o), a(SOUTH_EAST, EO, o));
                let [l_nw, l_ne, l_sw, l_se] = places(here, m - 1, n);
                let [h_nw, h_ne, h_sw, h_se] = places(here, m, n);
                let [v0, v1, v2, v3, v4, v5] = &mut products.even_odd[1];
                cut!(m, n, v0, v1, v2, v3, v4, v5);
                for x in 0..n {
                    let d = inverse[x].inverse();
                    v0[x] = d * no[x]
                        - up[x]
                        - left[x] * l_ne[x]
                        - right[x] * h_nw[x]
                        - c_nw[x] * e_west[x]
                        - c_ne[x] * w[x];
                    v1[x] = d * so[x]
                        - down[x]
                        - left[x] * l_se[x]
                        - right[x] * h_sw[x]
                        - c_sw[x] * e_below_west[x]
                        - c_se[x] * w_below[x];
                }
                for x in 0..n {
                    v2[x] = zero - left[x] * l_nw[x] - c_nw[x] * w_west[x];
                    v3[x] = zero - right[x] * h_ne[x] - c_ne[x] * e[x];
                    v4[x] = zero - left[x] * l_sw[x] - c_sw[x] * w_below_west[x];
                    v5[x] = zero - right[x] * h_se[x] - c_se[x] * e_below[x];
                }
            }
            {
                let inverse = &self.inverse[EE][o..][..n];
                let (left, right) = (a(EAST, OE, o - 1), a(EAST, EE, o));
                let (up, down) = (a(SOUTH, EO, o - s), a(SOUTH, EE, o));
                let (c_nw, c_ne) = (a(SOUTH_EAST, OO, o - s - 1), a(SOUTH_WEST, OO, o - s));
                let (c_sw, c_se) = (a(SOUTH_WEST, EE, o), a(SOUTH_EAST, EE, o));
                let [h_nw, h_ne, h_sw, h_se] = places(here, m, n);
                let [_, l_ne, l_sw, l_se] = places(here, m - 1, n);
                let [_, _, a_sw, a_se] = places(above, m, n);
                let al_se = &above[3][m - 1..][..n];
                let [p0, p1, p2, p3, p4] = &mut products.even_even;
                cut!(m, n, p0, p1, p2, p3, p4);
                for x in 0..n {
                    p0[x] = inverse[x].inverse()
                        - (right[x] * w[x]
                            + left[x] * e_west[x]
                            + down[x] * no[x]
                            + up[x] * so_above[x])
                        - (c_se[x] * h_nw[x]
                            + c_sw[x] * l_ne[x]
                            + c_ne[x] * a_sw[x]
                            + c_nw[x] * al_se[x]);
                }
                for x in 0..n {
                    p1[x] = zero - right[x] * e[x] - c_se[x] * h_ne[x] - c_ne[x] * a_se[x];
                    p2[x] = zero - down[x] * so[x] - c_se[x] * h_sw[x] - c_sw[x] * l_se[x];
                    p3[x] = zero - c_se[x] * h_se[x];
                    p4[x] = zero - c_sw[x] * l_sw[x];
                }
            }
            if y >= rows.start {
                products.finish_row([w, e_west, no, so_above], next, y);
            }
        }
    }
}
