//! The dense matrix of a front: symmetric, upper triangle stored by rows.

use super::super::wide::Wide;

/// A square symmetric matrix of which only the upper triangle is kept, and whose first rows are to be eliminated.
#[derive(Default)]
pub(super) struct Matrix {
    entries: Vec<f64>,
    size: usize,
    /// For each row to be eliminated, the column after its last entry that is not zero, never less than that of the row
    /// before: the rows of one distance meet those of the next one after the other.
    ends: Vec<usize>,
    wide: Wide,
}

impl Matrix {
    /// Makes this the zero matrix of `size` rows, the first `pivots` of which are to be eliminated.
    pub(super) fn reset(&mut self, size: usize, pivots: usize) {
        self.size = size;
        self.entries.clear();
        self.entries.resize(size * size, 0.0);
        self.ends.clear();
        self.ends.extend(1..=pivots);
    }

    /// Adds `value` to the entry of `row` and `column`, in either order.
    pub(super) fn add(&mut self, row: usize, column: usize, value: f64) {
        let (row, column) = (row.min(column), row.max(column));
        self.entries[row * self.size + column] += value;
        if let Some(end) = self.ends.get_mut(row) {
            *end = (*end).max(column + 1);
        }
    }

    /// Adds the upper triangle `update`, whose rows and columns go to `slots`.
    pub(super) fn add_update(&mut self, slots: &[u32], update: &[f64]) {
        let Some((&first, &last)) = slots.first().zip(slots.last()) else {
            return;
        };
        let ascending = slots.is_sorted();
        let contiguous = ascending && (last - first) as usize + 1 == slots.len();
        let mut rest = update;
        for (at, &slot) in slots.iter().enumerate() {
            let (values, after) = rest.split_at(slots.len() - at);
            rest = after;
            if !ascending {
                for (&other, &value) in slots[at..].iter().zip(values) {
                    self.add(slot as usize, other as usize, value);
                }
                continue;
            }
            let row = slot as usize * self.size;
            let row = &mut self.entries[row..row + self.size];
            if contiguous {
                for (entry, &value) in row[slot as usize..].iter_mut().zip(values) {
                    *entry += value;
                }
            } else {
                for (&other, &value) in slots[at..].iter().zip(values) {
                    row[other as usize] += value;
                }
            }
            if let Some(end) = self.ends.get_mut(slot as usize) {
                *end = (*end).max(last as usize + 1);
            }
        }
    }

    /// The diagonal entry of an eliminated row and what follows it, up to the last that is not zero.
    pub(super) fn row(&self, row: usize) -> (f64, &[f64]) {
        let start = row * self.size;
        let entries = &self.entries[start + row..start + self.ends[row]];
        (entries[0], &entries[1..])
    }

    /// Appends the upper triangle of the rows that were not eliminated, row by row.
    pub(super) fn copy_rest(&self, into: &mut Vec<f64>) {
        for row in self.ends.len()..self.size {
            into.extend_from_slice(&self.entries[row * self.size + row..(row + 1) * self.size]);
        }
    }

    /// Gauss elimination of the rows to be eliminated; the rest becomes the Schur complement on the other rows.
    pub(super) fn eliminate(&mut self) {
        for row in 1..self.ends.len() {
            self.ends[row] = self.ends[row].max(self.ends[row - 1]);
        }
        self.wide.run(
            #[inline(always)]
            || eliminate(&mut self.entries, self.size, &self.ends),
        );
    }
}

/// See [`Matrix::eliminate`].
#[inline(always)]
fn eliminate(entries: &mut [f64], size: usize, ends: &[usize]) {
    let mut start = 0;
    while start < ends.len() {
        // As many pivots at once as there are, in powers of two.
        start += match ends.len() - start {
            8.. => panel::<8>(entries, size, start, ends),
            4.. => panel::<4>(entries, size, start, ends),
            2.. => panel::<2>(entries, size, start, ends),
            _ => panel::<1>(entries, size, start, ends),
        };
    }
}

/// Eliminates `P` rows from `start` on and applies them to the rest in one pass over it; returns `P`.
#[inline(always)]
fn panel<const P: usize>(entries: &mut [f64], size: usize, start: usize, ends: &[usize]) -> usize {
    let end = start + P;
    let stop = ends[end - 1];
    for pivot in start..end {
        let (above, below) = entries.split_at_mut((pivot + 1) * size);
        let source = &above[pivot * size..];
        let inverse = 1.0 / source[pivot];
        for row in pivot + 1..end {
            let multiplier = source[row] * inverse;
            let target = &mut below[(row - pivot - 1) * size..][row..stop];
            for (t, s) in target.iter_mut().zip(&source[row..stop]) {
                *t -= multiplier * s;
            }
        }
    }
    let (panel, rest) = entries.split_at_mut(end * size);
    let panel = &panel[start * size..];
    let inverse: [f64; P] = std::array::from_fn(|q| 1.0 / panel[q * size + start + q]);
    for (row, target) in (end..stop).zip(rest.chunks_exact_mut(size)) {
        let multiplier: [f64; P] = std::array::from_fn(|q| panel[q * size + row] * inverse[q]);
        let target = &mut target[row..stop];
        let len = target.len();
        let sources: [&[f64]; P] = std::array::from_fn(|q| &panel[q * size + row..][..len]);
        for i in 0..len {
            // Two chains of sums, for the latency.
            let (mut even, mut odd) = (0.0, 0.0);
            let mut q = 0;
            while q + 1 < P {
                even += multiplier[q] * sources[q][i];
                odd += multiplier[q + 1] * sources[q + 1][i];
                q += 2;
            }
            if q < P {
                even += multiplier[q] * sources[q][i];
            }
            target[i] -= even + odd;
        }
    }
    P
}
