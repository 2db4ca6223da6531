//! Row kernels of the coarser levels, separate because only an argument tells the compiler that the
//! output overlaps no input.

use super::grid::first;
use crate::real::Real;

/// Writes (`f` + sum of `terms`) / diagonal.
#[inline(always)]
pub(super) fn relax<R: Real, const COUNT: usize>(
    out: &mut [R],
    f: &[R],
    inverse: &[R],
    terms: &[(&[R], &[R]); COUNT],
) {
    for x in 0..out.len() {
        out[x] = ((f[x] + sum_at(terms, x)) * inverse[x]).flushed();
    }
}

#[inline(always)]
pub(super) fn add_active<R: Real>(u: &mut [R], inverse: &[R], values: &[R]) {
    let n = u.len();
    first!(n, inverse, values);
    for x in 0..n {
        u[x] += inverse[x].is_active() * values[x];
    }
}

/// Sums `own` where active and four weighted values.
#[inline(always)]
pub(super) fn sum_weighted<R: Real>(
    out: &mut [R],
    inverse: &[R],
    own: &[R],
    weights: [&[R]; 4],
    values: [&[R]; 4],
) {
    let n = out.len();
    let ([s, t, v, w], [a, b, c, d]) = (weights, values);
    first!(n, inverse, own, s, t, v, w, a, b, c, d);
    for x in 0..n {
        let around = (s[x] * a[x] + t[x] * b[x]) + (v[x] * c[x] + w[x] * d[x]);
        out[x] = (inverse[x].is_active() * own[x] + around).flushed();
    }
}

/// Subtracts the left side of the equations from f; 0 for inactive cells.
#[inline(always)]
pub(super) fn subtract<R: Real, const COUNT: usize>(
    f: &mut [R],
    u: &[R],
    inverse: &[R],
    terms: &[(&[R], &[R]); COUNT],
) {
    for x in 0..f.len() {
        let active = inverse[x].is_active();
        let residual = (f[x] + sum_at(terms, x)) - inverse[x].inverse() * u[x];
        f[x] = (active * residual).flushed();
    }
}

#[inline(always)]
pub(super) fn gather<R: Real, const COUNT: usize>(out: &mut [R], terms: &[(&[R], &[R]); COUNT]) {
    for (x, out) in out.iter_mut().enumerate() {
        *out = sum_at(terms, x);
    }
}

/// Sums the products at one place of the rows.
///
/// Pairwise sums by index let the compiler keep the rows in registers.
#[inline(always)]
fn sum_at<R: Real, const COUNT: usize>(terms: &[(&[R], &[R]); COUNT], x: usize) -> R {
    let product = |k: usize| terms[k].0[x] * terms[k].1[x];
    match COUNT {
        0 => R::default(),
        2 => product(0) + product(1),
        6 => (product(0) + product(1)) + (product(2) + product(3)) + (product(4) + product(5)),
        _ => {
            ((product(0) + product(1)) + (product(2) + product(3)))
                + ((product(4) + product(5)) + (product(6) + product(7)))
        }
    }
}
