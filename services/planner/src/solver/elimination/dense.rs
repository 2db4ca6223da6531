//! The dense matrix of a front: symmetric, upper triangle stored by rows.

use super::super::wide::Wide;

/// Pivots whose updates are applied to the rest of the matrix in one pass over it.
const PANEL: usize = 8;

/// A square symmetric matrix of which only the upper triangle is kept.
#[derive(Default)]
pub(super) struct Matrix {
    entries: Vec<f64>,
    size: usize,
    wide: Wide,
}

impl Matrix {
    /// Makes this the zero matrix of `size` rows.
    pub(super) fn reset(&mut self, size: usize) {
        self.size = size;
        self.entries.clear();
        self.entries.resize(size * size, 0.0);
    }

    /// Adds `value` to the entry of `row` and `column`, in either order.
    pub(super) fn add(&mut self, row: usize, column: usize, value: f64) {
        let (row, column) = (row.min(column), row.max(column));
        self.entries[row * self.size + column] += value;
    }

    /// The diagonal entry of `row` and the entries to its right.
    pub(super) fn row(&self, row: usize) -> (f64, &[f64]) {
        let start = row * self.size;
        (
            self.entries[start + row],
            &self.entries[start + row + 1..start + self.size],
        )
    }

    /// Appends the upper triangle from `first` on, row by row.
    pub(super) fn copy_upper(&self, first: usize, into: &mut Vec<f64>) {
        for row in first..self.size {
            into.extend_from_slice(&self.entries[row * self.size + row..(row + 1) * self.size]);
        }
    }

    /// Gauss elimination of the first `pivots` rows; the rest becomes the Schur complement on the other rows.
    pub(super) fn eliminate(&mut self, pivots: usize) {
        self.wide.run(
            #[inline(always)]
            || eliminate(&mut self.entries, self.size, pivots),
        );
    }
}

/// See [`Matrix::eliminate`].
#[inline(always)]
fn eliminate(entries: &mut [f64], size: usize, pivots: usize) {
    let mut start = 0;
    while start < pivots {
        let end = pivots.min(start + PANEL);
        for pivot in start..end {
            let (above, below) = entries.split_at_mut((pivot + 1) * size);
            let source = &above[pivot * size..];
            let inverse = 1.0 / source[pivot];
            for row in pivot + 1..end {
                let multiplier = source[row] * inverse;
                if multiplier != 0.0 {
                    let target = &mut below[(row - pivot - 1) * size..][row..size];
                    for (t, s) in target.iter_mut().zip(&source[row..size]) {
                        *t -= multiplier * s;
                    }
                }
            }
        }
        let (panel, rest) = entries.split_at_mut(end * size);
        let panel = &panel[start * size..];
        if end - start == PANEL {
            apply_full_panel(panel, rest, start, size);
        } else {
            apply_panel(panel, rest, start, end, size);
        }
        start = end;
    }
}

/// Subtracts from every row of `rest` its share of the `PANEL` pivot rows in `panel`.
#[inline(always)]
fn apply_full_panel(panel: &[f64], rest: &mut [f64], start: usize, size: usize) {
    let inverse: [f64; PANEL] = std::array::from_fn(|q| 1.0 / panel[q * size + start + q]);
    for (row, target) in (start + PANEL..size).zip(rest.chunks_exact_mut(size)) {
        let multiplier: [f64; PANEL] = std::array::from_fn(|q| panel[q * size + row] * inverse[q]);
        if multiplier.iter().all(|&m| m == 0.0) {
            continue;
        }
        let target = &mut target[row..];
        let len = target.len();
        let [s0, s1, s2, s3, s4, s5, s6, s7]: [&[f64]; PANEL] =
            std::array::from_fn(|q| &panel[q * size + row..][..len]);
        for i in 0..len {
            let first = (multiplier[0] * s0[i] + multiplier[1] * s1[i])
                + (multiplier[2] * s2[i] + multiplier[3] * s3[i]);
            let second = (multiplier[4] * s4[i] + multiplier[5] * s5[i])
                + (multiplier[6] * s6[i] + multiplier[7] * s7[i]);
            target[i] -= first + second;
        }
    }
}

/// As [`apply_full_panel`] for the last, narrower panel.
#[inline(always)]
fn apply_panel(panel: &[f64], rest: &mut [f64], start: usize, end: usize, size: usize) {
    for (row, target) in (end..size).zip(rest.chunks_exact_mut(size)) {
        for q in 0..end - start {
            let multiplier = panel[q * size + row] / panel[q * size + start + q];
            if multiplier != 0.0 {
                for (t, s) in target[row..].iter_mut().zip(&panel[q * size + row..]) {
                    *t -= multiplier * s;
                }
            }
        }
    }
}
