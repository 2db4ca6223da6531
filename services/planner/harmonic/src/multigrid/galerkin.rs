//! Interpolation from a coarser level, and its equations: interpolation transposed times the finer
//! equations times interpolation.
//!
//! Interpolation to an odd-odd cell satisfies the equation of that cell, so that product row
//! vanishes. The rows of the other cells are formed one row of cells at a time and summed with
//! their weights on the coarse cell. A loop per term takes 7 % longer for the whole set-up.

use std::ops::Range;

use super::{
    coarse::Coarse,
    couplings::{Couplings as _, Level},
    grid::{E, EE, EO, Grid, MARGIN, N, NE, NW, OE, OO, S, SE, SW, Step, W, cut, first, split_row},
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
    /// Row above, this row; by coarse cell: north, south, north-west, south-west, north-east,
    /// south-east.
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
        let [v_n, v_s, _, v_sw, v_ne, v_se] = places(&self.even_odd[1], m, n);
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
    let across = |step| fine.across((OO, o), step, n);
    let (up, down, left, right) = (across(N), across(S), across(W), across(E));
    let diagonal = |step| fine.diagonal((OO, o), step, n);
    let (c_nw, c_ne, c_sw, c_se) = (diagonal(NW), diagonal(NE), diagonal(SW), diagonal(SE));
    for x in 0..n {
        nw[x] = inverse[x] * (c_nw.at(x) + up.times(x, w[x]) + left.times(x, no[x]));
        ne[x] = inverse[x] * (c_ne.at(x) + up.times(x, e[x]) + right.times(x, no_east[x]));
    }
    for x in 0..n {
        sw[x] = inverse[x] * (c_sw.at(x) + down.times(x, w_below[x]) + left.times(x, so[x]));
        se[x] = inverse[x] * (c_se.at(x) + down.times(x, e_below[x]) + right.times(x, so_east[x]));
    }
}

/// Plane of the cells between coarse cells in a row or a column, and the steps from a cell to both
/// coarse cells and to either side.
#[derive(Clone, Copy)]
struct Line {
    plane: usize,
    ends: [Step; 2],
    sides: [Step; 2],
}

const IN_ROW: Line = Line { plane: OE, ends: [W, E], sides: [N, S] };
const IN_COLUMN: Line = Line { plane: EO, ends: [N, S], sides: [W, E] };

/// Multiplies the equations of `n` cells of a line from `o` by the interpolation.
///
/// `out` is by coarse cell: ends a and b, then corners pa, pb, qa and qb at the sides p and q.
/// `weights` belong to the line, `sides` to the odd-odd cells beside it. `corners` belong to the
/// diagonal neighbours: on the end, then on the coarse cell at the corner.
#[inline(always)]
fn multiply<R: Real>(
    fine: &impl Level<R>,
    Line { plane, ends: [a, b], sides: [p, q] }: Line,
    (o, n): (usize, usize),
    out: &mut Rows<R, 6>,
    weights: [&[R]; 2],
    sides: [[&[R]; 4]; 2],
    corners: [[&[R]; 2]; 4],
) {
    let (here, zero) = ((plane, o), R::default());
    let inverse = &fine.inverse()[plane][o..][..n];
    let (to_a, to_b) = (fine.along(here, a, n), fine.along(here, b, n));
    let (to_p, to_q) = (fine.across(here, p, n), fine.across(here, q, n));
    let diagonal = |end, side| fine.diagonal(here, corner(end, side), n);
    let (c_pa, c_pb, c_qa, c_qb) = (diagonal(a, p), diagonal(b, p), diagonal(a, q), diagonal(b, q));
    let [w_a, w_b] = weights;
    let [[p_pa, p_pb, p_a, p_b], [q_a, q_b, q_qa, q_qb]] = sides;
    let [[pa_a, pa], [pb_b, pb], [qa_a, qa], [qb_b, qb]] = corners;
    let [out_a, out_b, out_pa, out_pb, out_qa, out_qb] = out;
    cut!(MARGIN, n, out_a, out_b, out_pa, out_pb, out_qa, out_qb);
    for x in 0..n {
        let d = inverse[x].inverse();
        out_a[x] = d * w_a[x]
            - to_a.at(x)
            - to_p.times(x, p_a[x])
            - to_q.times(x, q_a[x])
            - c_pa.times(x, pa_a[x])
            - c_qa.times(x, qa_a[x]);
        out_b[x] = d * w_b[x]
            - to_b.at(x)
            - to_p.times(x, p_b[x])
            - to_q.times(x, q_b[x])
            - c_pb.times(x, pb_b[x])
            - c_qb.times(x, qb_b[x]);
    }
    for x in 0..n {
        out_pa[x] = zero - to_p.times(x, p_pa[x]) - c_pa.times(x, pa[x]);
        out_pb[x] = zero - to_p.times(x, p_pb[x]) - c_pb.times(x, pb[x]);
        out_qa[x] = zero - to_q.times(x, q_qa[x]) - c_qa.times(x, qa[x]);
        out_qb[x] = zero - to_q.times(x, q_qb[x]) - c_qb.times(x, qb[x]);
    }
}

#[inline(always)]
const fn corner(end: Step, side: Step) -> Step {
    (end.0 + side.0, end.1 + side.1)
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
        multiply(
            fine,
            IN_ROW,
            (o, n),
            &mut products.odd_even,
            [w, e],
            [[a_nw, a_ne, a_sw, a_se], [h_nw, h_ne, h_sw, h_se]],
            [[so_above, no_above], [so_above_east, no_above_east], [no, so], [no_east, so_east]],
        );
        multiply(
            fine,
            IN_COLUMN,
            (o, n),
            &mut products.even_odd[1],
            [no, so],
            [[l_nw, l_sw, l_ne, l_se], [h_nw, h_sw, h_ne, h_se]],
            [[e_west, w_west], [e_below_west, w_below_west], [w, e], [w_below, e_below]],
        );
        {
            let inverse = &fine.inverse()[EE][o..][..n];
            // On the finest level, the cell at the end of the step decides: the coarse one.
            let (left, right) = (fine.along((OE, o - 1), E, n), fine.along((OE, o), W, n));
            let (up, down) = (fine.along((EO, o - s), S, n), fine.along((EO, o), N, n));
            let diagonal = |step| fine.diagonal((EE, o), step, n);
            let (c_nw, c_ne, c_sw, c_se) = (diagonal(NW), diagonal(NE), diagonal(SW), diagonal(SE));
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
    let n = fine.grid().columns;
    let mut weights = std::mem::take(fine.weights_mut());
    for y in rows {
        let o = fine.grid().start(y);
        let [to_west, to_east, to_north, to_south] = &mut weights;
        weigh(fine, IN_ROW, (o, n), [to_west, to_east]);
        weigh(fine, IN_COLUMN, (o, n), [to_north, to_south]);
    }
    *fine.weights_mut() = weights;
}

/// Sets the weights of `n` cells of a line from `o` on the coarse cells at its ends.
#[inline(always)]
fn weigh<R: Real>(
    fine: &impl Level<R>,
    Line { plane, ends: [a, b], sides: [p, q] }: Line,
    (o, n): (usize, usize),
    [to_a, to_b]: [&mut Vec<R>; 2],
) {
    let (here, least) = ((plane, o), R::of(1e-4));
    let along = |step| fine.along(here, step, n);
    let diagonal = |end, side| fine.diagonal(here, corner(end, side), n);
    let own = &fine.inverse()[plane][o..][..n];
    let (c_a, c_b, c_p, c_q) = (along(a), along(b), along(p), along(q));
    let (c_pa, c_pb, c_qa, c_qb) = (diagonal(a, p), diagonal(b, p), diagonal(a, q), diagonal(b, q));
    cut!(o, n, to_a, to_b);
    for x in 0..n {
        let d = own[x].inverse();
        let rest = d - c_p.at(x) - c_q.at(x);
        let share = if rest > least * d { R::ONE / rest } else { R::default() };
        let (at_a, at_b) = (c_a.at(x), c_b.at(x));
        to_a[x] = at_a.is_active() * (at_a + c_pa.at(x) + c_qa.at(x)) * share;
        to_b[x] = at_b.is_active() * (at_b + c_pb.at(x) + c_qb.at(x)) * share;
    }
}
