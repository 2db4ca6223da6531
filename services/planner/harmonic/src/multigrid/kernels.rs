//! The work of a coarser level on rows of values. These are functions of their own because only an argument tells the
//! compiler that the output overlaps no input.

use super::grid::first;
use crate::real::Real;

/// `f` and the sum of `terms`, divided by the diagonal.
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

/// The sum of `own` where active and four weighted values.
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

/// f less the equations' left side; 0 for inactive cells.
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

/// The sum of products at one place of the rows. It is pairwise and by index: the compiler then keeps the rows in
/// registers.
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
