//! Interpolation from a coarser level, and its equations: interpolation transposed times the finer
//! equations times interpolation.
//!
//! Interpolation to an odd-odd cell satisfies the equation of that cell, so that product row
//! vanishes. The rows of the other cells are formed one row of cells at a time and summed with
//! their weights on the coarse cell. A loop per term takes 7 % longer for the whole set-up.

use std::ops::Range;

use super::{
    coarse::Coarse,
    couplings::{Couplings as _, EAST, Level, SOUTH, SOUTH_EAST, SOUTH_WEST},
    grid::{EE, EO, Grid, MARGIN, OE, OO, cut, first, split_row},
};
use crate::real::Real;

type Rows<R, const COUNT: usize> = [Vec<R>; COUNT];

/// Intermediate rows from a fine level to the next, reused between set-ups.
#[derive(Debug)]
pub(super) struct Products<R> {
    /// Row above, this row.
    corner: [Rows<R, 4>; 2],
    /// By coarse cell: west, east, north-west, north-east, south-west, south-east.
    odd_even: Rows<R, 6>,
    /// Row above, this row; by coarse cell: north, south, then as above.
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
            corner: [rows(grid), rows(grid)],
            odd_even: rows(grid),
            even_odd: [rows(grid), rows(grid)],
            even_even: rows(grid),
            out: rows(grid),
        }
    }

    #[inline(always)]
    fn finish_row(
        &mut self,
        [west, east, north, south]: [&[R]; 4],
        next: &mut Coarse<R>,
        y: usize,
    ) {
        let (n, zero, m) = (next.grid.width, R::default(), MARGIN);
        let [e0, e1, e2, e3, e4] = places(&self.even_even, m, n);
        let [q_w, q_e, .., q_sw, q_se] = places(&self.odd_even, m, n);
        let [_, west_q_e, .., west_q_sw, west_q_se] = places(&self.odd_even, m - 1, n);
        let [v_n, v_s, _, v_ne, v_sw, v_se] = places(&self.even_odd[1], m, n);
        let [_, above_v_s, .., above_v_se] = places(&self.even_odd[0], m, n);
        let [diagonal, right, down, down_right, down_left] = &mut self.out;

        for (x, out) in diagonal[..n].iter_mut().enumerate() {
            let sum = e0[x]
                + west[x] * q_w[x]
                + east[x] * west_q_e[x]
                + north[x] * v_n[x]
                + south[x] * above_v_s[x];
            *out = if e0[x] > zero { sum } else { zero };
        }
        for (x, out) in right[..n].iter_mut().enumerate() {
            *out =
                zero - (e1[x] + west[x] * q_e[x] + north[x] * v_ne[x] + south[x] * above_v_se[x]);
        }
        for (x, out) in down[..n].iter_mut().enumerate() {
            *out = zero - (e2[x] + west[x] * q_sw[x] + east[x] * west_q_se[x] + north[x] * v_s[x]);
        }
        for (x, out) in down_right[..n].iter_mut().enumerate() {
            *out = zero - (e3[x] + west[x] * q_se[x] + north[x] * v_se[x]);
        }
        for (x, out) in down_left[..n].iter_mut().enumerate() {
            *out = zero - (e4[x] + east[x] * west_q_sw[x] + north[x] * v_sw[x]);
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

/// Computes the weights of `n` odd-odd cells from `o` on their north-west, north-east, south-west
/// and south-east coarse cells.
///
/// They follow from the equation of the cell, with its neighbours interpolated.
#[inline(always)]
pub(super) fn corner_weights<R: Real>(
    fine: &impl Level<R>,
    o: usize,
    n: usize,
    [nw, ne, sw, se]: [&mut [R]; 4],
) {
    let below = o + fine.grid().stride;
    let [west, east, north, south] = fine.weights();
    let (w, e, w_below, e_below) = (&west[o..], &east[o..], &west[below..], &east[below..]);
    let (no, so, no_east, so_east) = (&north[o..], &south[o..], &north[o + 1..], &south[o + 1..]);
    cut!(0, n, nw, ne, sw, se);
    first!(n, w, e, w_below, e_below, no, so, no_east, so_east);
    let inverse = &fine.inverse()[OO][o..][..n];
    let (up, down) = (fine.across(SOUTH, (OE, o), n), fine.across(SOUTH, (OO, o), n));
    let (left, right) = (fine.across(EAST, (EO, o), n), fine.across(EAST, (OO, o), n));
    let c_nw = fine.diagonal(SOUTH_EAST, (EE, o), n);
    let c_ne = fine.diagonal(SOUTH_WEST, (EE, o + 1), n);
    let c_sw = fine.diagonal(SOUTH_WEST, (OO, o), n);
    let c_se = fine.diagonal(SOUTH_EAST, (OO, o), n);
    for x in 0..n {
        nw[x] = inverse[x] * (c_nw.at(x) + up.times(x, w[x]) + left.times(x, no[x]));
        ne[x] = inverse[x] * (c_ne.at(x) + up.times(x, e[x]) + right.times(x, no_east[x]));
    }
    for x in 0..n {
        sw[x] = inverse[x] * (c_sw.at(x) + down.times(x, w_below[x]) + left.times(x, so[x]));
        se[x] = inverse[x] * (c_se.at(x) + down.times(x, e_below[x]) + right.times(x, so_east[x]));
    }
}

#[inline(always)]
pub(super) fn coarsen<R: Real>(
    fine: &impl Level<R>,
    next: &mut Coarse<R>,
    rows: Range<usize>,
    products: &mut Products<R>,
) {
    let Grid { columns: n, stride: s, .. } = fine.grid();
    let (zero, m) = (R::default(), MARGIN);
    let Products { corner: [_, corner], even_odd: [_, even_odd], .. } = products;
    for row in corner.iter_mut().chain(even_odd) {
        row.fill(zero);
    }
    let [west, east, north, south] = fine.weights();
    let we = |at: usize| [&west[at..][..n], &east[at..][..n]];
    let ns = |at: usize| [&north[at..][..n], &south[at..][..n]];
    // The row before the first contributes to the first row.
    for y in rows.start.saturating_sub(1)..rows.end {
        products.corner.swap(0, 1);
        products.even_odd.swap(0, 1);
        let o = fine.grid().start(y);
        let along =
            |direction, plane, start, there| fine.along(direction, (plane, start), (EE, there), n);
        let across = |direction, plane, start| fine.across(direction, (plane, start), n);
        let diagonal = |direction, plane, start| fine.diagonal(direction, (plane, start), n);
        let ([w, e], [no, so], [no_east, so_east]) = (we(o), ns(o), ns(o + 1));
        let ([w_west, e_west], [w_below_west, e_below_west]) = (we(o - 1), we(o + s - 1));
        let [w_below, e_below] = we(o + s);
        let ([no_above, so_above], [no_above_east, so_above_east]) = (ns(o - s), ns(o - s + 1));

        let [nw, ne, sw, se] = &mut products.corner[1];
        cut!(m, n, nw, ne, sw, se);
        corner_weights(fine, o, n, [nw, ne, sw, se]);
        let [above, here] = &products.corner;
        let [a_nw, a_ne, a_sw, a_se] = places(above, m, n);
        let [h_nw, h_ne, h_sw, h_se] = places(here, m, n);
        let [l_nw, l_ne, l_sw, l_se] = places(here, m - 1, n);
        {
            let inverse = &fine.inverse()[OE][o..][..n];
            let (left, right) = (along(EAST, EE, o, o), along(EAST, OE, o, o + 1));
            let (up, down) = (across(SOUTH, OO, o - s), across(SOUTH, OE, o));
            let (c_nw, c_ne) =
                (diagonal(SOUTH_EAST, EO, o - s), diagonal(SOUTH_WEST, EO, o - s + 1));
            let (c_sw, c_se) = (diagonal(SOUTH_WEST, OE, o), diagonal(SOUTH_EAST, OE, o));
            let [q0, q1, q2, q3, q4, q5] = &mut products.odd_even;
            cut!(m, n, q0, q1, q2, q3, q4, q5);
            for x in 0..n {
                let d = inverse[x].inverse();
                q0[x] = d * w[x]
                    - left.at(x)
                    - up.times(x, a_sw[x])
                    - down.times(x, h_nw[x])
                    - c_nw.times(x, so_above[x])
                    - c_sw.times(x, no[x]);
                q1[x] = d * e[x]
                    - right.at(x)
                    - up.times(x, a_se[x])
                    - down.times(x, h_ne[x])
                    - c_ne.times(x, so_above_east[x])
                    - c_se.times(x, no_east[x]);
            }
            for x in 0..n {
                q2[x] = zero - up.times(x, a_nw[x]) - c_nw.times(x, no_above[x]);
                q3[x] = zero - up.times(x, a_ne[x]) - c_ne.times(x, no_above_east[x]);
                q4[x] = zero - down.times(x, h_sw[x]) - c_sw.times(x, so[x]);
                q5[x] = zero - down.times(x, h_se[x]) - c_se.times(x, so_east[x]);
            }
        }
        {
            let inverse = &fine.inverse()[EO][o..][..n];
            let (up, down) = (along(SOUTH, EE, o, o), along(SOUTH, EO, o, o + s));
            let (left, right) = (across(EAST, OO, o - 1), across(EAST, EO, o));
            let (c_nw, c_ne) = (diagonal(SOUTH_EAST, OE, o - 1), diagonal(SOUTH_WEST, OE, o));
            let (c_sw, c_se) = (diagonal(SOUTH_WEST, EO, o), diagonal(SOUTH_EAST, EO, o));
            let [v0, v1, v2, v3, v4, v5] = &mut products.even_odd[1];
            cut!(m, n, v0, v1, v2, v3, v4, v5);
            for x in 0..n {
                let d = inverse[x].inverse();
                v0[x] = d * no[x]
                    - up.at(x)
                    - left.times(x, l_ne[x])
                    - right.times(x, h_nw[x])
                    - c_nw.times(x, e_west[x])
                    - c_ne.times(x, w[x]);
                v1[x] = d * so[x]
                    - down.at(x)
                    - left.times(x, l_se[x])
                    - right.times(x, h_sw[x])
                    - c_sw.times(x, e_below_west[x])
                    - c_se.times(x, w_below[x]);
            }
            for x in 0..n {
                v2[x] = zero - left.times(x, l_nw[x]) - c_nw.times(x, w_west[x]);
                v3[x] = zero - right.times(x, h_ne[x]) - c_ne.times(x, e[x]);
                v4[x] = zero - left.times(x, l_sw[x]) - c_sw.times(x, w_below_west[x]);
                v5[x] = zero - right.times(x, h_se[x]) - c_se.times(x, e_below[x]);
            }
        }
        {
            let inverse = &fine.inverse()[EE][o..][..n];
            let (left, right) = (along(EAST, OE, o - 1, o), along(EAST, EE, o, o));
            let (up, down) = (along(SOUTH, EO, o - s, o), along(SOUTH, EE, o, o));
            let (c_nw, c_ne) =
                (diagonal(SOUTH_EAST, OO, o - s - 1), diagonal(SOUTH_WEST, OO, o - s));
            let (c_sw, c_se) = (diagonal(SOUTH_WEST, EE, o), diagonal(SOUTH_EAST, EE, o));
            let al_se = &above[3][m - 1..][..n];
            let [p0, p1, p2, p3, p4] = &mut products.even_even;
            cut!(m, n, p0, p1, p2, p3, p4);
            for x in 0..n {
                p0[x] = inverse[x].inverse()
                    - (right.times(x, w[x])
                        + left.times(x, e_west[x])
                        + down.times(x, no[x])
                        + up.times(x, so_above[x]))
                    - (c_se.times(x, h_nw[x])
                        + c_sw.times(x, l_ne[x])
                        + c_ne.times(x, a_sw[x])
                        + c_nw.times(x, al_se[x]));
            }
            for x in 0..n {
                p1[x] =
                    zero - right.times(x, e[x]) - c_se.times(x, h_ne[x]) - c_ne.times(x, a_se[x]);
                p2[x] =
                    zero - down.times(x, so[x]) - c_se.times(x, h_sw[x]) - c_sw.times(x, l_se[x]);
                p3[x] = zero - c_se.times(x, h_se[x]);
                p4[x] = zero - c_sw.times(x, l_sw[x]);
            }
        }
        if y >= rows.start {
            products.finish_row([w, e_west, no, so_above], next, y);
        }
    }
}

/// Sets `rows` of the interpolation along the lines between coarse cells.
///
/// Couplings to diagonal neighbours are added to those along the line. Couplings straight across
/// are subtracted from the diagonal.
///
/// A coarse cell contributes only to cells coupled to it. Otherwise a wall between them or at the
/// coarse cell would couple the corrections on both sides. Far from the target, the cycles would
/// then fail to converge.
#[inline(always)]
pub(super) fn interpolate<R: Real>(fine: &mut impl Level<R>, rows: Range<usize>) {
    let Grid { columns: n, stride: s, .. } = fine.grid();
    let least = R::of(1e-4);
    let share = |d: R, a: R, b: R| {
        let rest = d - a - b;
        if rest > least * d { R::ONE / rest } else { R::default() }
    };
    let mut weights = std::mem::take(fine.weights_mut());
    for y in rows {
        let o = fine.grid().start(y);
        let along = |direction, owner, there| fine.along(direction, owner, there, n);
        let diagonal = |direction, plane, start| fine.diagonal(direction, (plane, start), n);
        let [to_west, to_east, to_north, to_south] = &mut weights;
        cut!(o, n, to_west, to_east, to_north, to_south);
        let own = &fine.inverse()[OE][o..][..n];
        let (w, e) = (along(EAST, (EE, o), (EE, o)), along(EAST, (OE, o), (EE, o + 1)));
        let (nw, ne) = (diagonal(SOUTH_EAST, EO, o - s), diagonal(SOUTH_WEST, EO, o + 1 - s));
        let (sw, se) = (diagonal(SOUTH_WEST, OE, o), diagonal(SOUTH_EAST, OE, o));
        let (no, so) = (along(SOUTH, (OO, o - s), (OO, o - s)), along(SOUTH, (OE, o), (OO, o)));
        for x in 0..n {
            let share = share(own[x].inverse(), no.at(x), so.at(x));
            let (w, e) = (w.at(x), e.at(x));
            to_west[x] = w.is_active() * (w + nw.at(x) + sw.at(x)) * share;
            to_east[x] = e.is_active() * (e + ne.at(x) + se.at(x)) * share;
        }
        let own = &fine.inverse()[EO][o..][..n];
        let (no, so) = (along(SOUTH, (EE, o), (EE, o)), along(SOUTH, (EO, o), (EE, o + s)));
        let (nw, ne) = (diagonal(SOUTH_EAST, OE, o - 1), diagonal(SOUTH_WEST, OE, o));
        let (sw, se) = (diagonal(SOUTH_WEST, EO, o), diagonal(SOUTH_EAST, EO, o));
        let (w, e) = (along(EAST, (OO, o - 1), (OO, o - 1)), along(EAST, (EO, o), (OO, o)));
        for x in 0..n {
            let share = share(own[x].inverse(), w.at(x), e.at(x));
            let (no, so) = (no.at(x), so.at(x));
            to_north[x] = no.is_active() * (no + nw.at(x) + ne.at(x)) * share;
            to_south[x] = so.is_active() * (so + sw.at(x) + se.at(x)) * share;
        }
    }
    *fine.weights_mut() = weights;
}
