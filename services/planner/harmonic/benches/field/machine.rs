//! Lower bounds of this machine: stream the grid, and sweep over it once.

use crate::{fastest, runs};

/// Reading and writing n x n floats once.
pub(crate) fn stream(n: usize) -> f64 {
    let mut values = vec![1.0_f32; n * n];
    fastest(4 * runs(n * n), || {
        for value in &mut values {
            *value *= 1.000_001;
        }
        std::hint::black_box(&mut values);
    })
}

/// The time of a red-black sweep over n x n cells in four planes by parity, with both colours in one pass over memory and masks of a
/// byte.
pub(crate) fn sweep(n: usize) -> f64 {
    let half = n / 2;
    let stride = half + 32;
    let len = stride * (half + 2) + 64;
    let mut planes: [Vec<f32>; 4] = std::array::from_fn(|_| vec![0.5; len]);
    let masks: [Vec<u8>; 4] = std::array::from_fn(|_| vec![1; len]);
    let arch = pulp::Arch::new();
    fastest(4 * runs(n * n), || {
        arch.dispatch(Sweep { planes: &mut planes, masks: &masks, half, stride });
    })
}

struct Sweep<'a> {
    planes: &'a mut [Vec<f32>; 4],
    masks: &'a [Vec<u8>; 4],
    half: usize,
    stride: usize,
}

impl pulp::WithSimd for Sweep<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { planes, masks, half, stride } = self;
        let [ee, oe, eo, oo] = planes;
        for y in 0..=half {
            if y < half {
                let o = (y + 1) * stride + 16;
                relax(
                    &mut ee[o..][..half],
                    [&oe[o..], &oe[o - 1..], &eo[o..], &eo[o - stride..]],
                    &masks[0][o..],
                );
                relax(
                    &mut oo[o..][..half],
                    [&oe[o..], &oe[o + stride..], &eo[o..], &eo[o + 1..]],
                    &masks[3][o..],
                );
            }
            if y >= 1 {
                let o = y * stride + 16;
                relax(
                    &mut oe[o..][..half],
                    [&ee[o..], &ee[o + 1..], &oo[o..], &oo[o - stride..]],
                    &masks[1][o..],
                );
                relax(
                    &mut eo[o..][..half],
                    [&ee[o..], &ee[o + stride..], &oo[o..], &oo[o - 1..]],
                    &masks[2][o..],
                );
            }
        }
    }
}

#[inline(always)]
fn relax(out: &mut [f32], around: [&[f32]; 4], mask: &[u8]) {
    let n = out.len();
    let [a, b, c, d] = around.map(|row| &row[..n]);
    let mask = &mask[..n];
    for x in 0..n {
        out[x] = ((a[x] + b[x]) + (c[x] + d[x])) * 0.25 * f32::from(mask[x]);
    }
}
