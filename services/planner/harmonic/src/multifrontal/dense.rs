//! Dense matrix of a front: symmetric, upper triangle stored by rows.

use crate::simd::Simd;

/// Columns computed together: a wide vector.
const BLOCK: usize = 4;

#[derive(Default)]
pub(super) struct Matrix {
    entries: Vec<f64>,
    size: usize,
    /// Entries from one row to the next; a multiple of [`BLOCK`].
    stride: usize,
    /// Column after the last nonzero entry, for each row to eliminate.
    ///
    /// The values never decrease, because the rows of one distance meet those of the next in order.
    ends: Vec<usize>,
    simd: Simd,
}

impl Matrix {
    pub(super) fn reset(&mut self, size: usize, pivots: usize) {
        assert!(pivots <= size);
        self.size = size;
        self.entries.clear();
        self.stride = size.next_multiple_of(BLOCK);
        self.entries.resize(size * self.stride, 0.0);
        self.ends.clear();
        self.ends.extend(1..=pivots);
    }

    /// Row and column may be swapped.
    pub(super) fn add(&mut self, row: usize, column: usize, value: f64) {
        debug_assert!(row.max(column) < self.size);
        let (row, column) = (row.min(column), row.max(column));
        self.entries[row * self.stride + column] += value;
        if let Some(end) = self.ends.get_mut(row) {
            *end = (*end).max(column + 1);
        }
    }

    pub(super) fn add_update(&mut self, slots: &[u32], update: &[f64]) {
        assert_eq!(update.len(), slots.len() * (slots.len() + 1) / 2);
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
            let row = slot as usize * self.stride;
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

    /// Returns the diagonal entry of an eliminated row and its later entries, up to the last
    /// nonzero.
    pub(super) fn row(&self, row: usize) -> (f64, &[f64]) {
        let start = row * self.stride;
        let entries = &self.entries[start + row..start + self.ends[row]];
        (entries[0], &entries[1..])
    }

    pub(super) fn copy_rest(&self, into: &mut Vec<f64>) {
        for row in self.ends.len()..self.size {
            let start = row * self.stride;
            into.extend_from_slice(&self.entries[start + row..start + self.size]);
        }
    }

    /// Eliminates the first rows by Gauss; the rest becomes the Schur complement.
    pub(super) fn eliminate(&mut self) {
        debug_assert!(self.ends.iter().all(|end| *end <= self.size));
        for row in 1..self.ends.len() {
            self.ends[row] = self.ends[row].max(self.ends[row - 1]);
        }
        self.simd.run(
            #[inline(always)]
            || eliminate(&mut self.entries, self.stride, &self.ends),
        );
    }
}

#[inline(always)]
fn eliminate(entries: &mut [f64], stride: usize, ends: &[usize]) {
    let mut start = 0;
    while start < ends.len() {
        // Each panel takes the largest power of two of rows that fits, up to eight.
        start += match ends.len() - start {
            8.. => panel::<8>(entries, stride, start, ends),
            4.. => panel::<4>(entries, stride, start, ends),
            2.. => panel::<2>(entries, stride, start, ends),
            _ => panel::<1>(entries, stride, start, ends),
        };
    }
}

/// Eliminates `P` rows from `start` on and applies them to the rest in one pass; returns `P`.
///
/// The pass takes whole blocks of columns, so short rows need no remainder loops. It writes values
/// below the diagonal that are never read, and adds zeros beyond `stop`.
#[inline(always)]
fn panel<const P: usize>(
    entries: &mut [f64],
    stride: usize,
    start: usize,
    ends: &[usize],
) -> usize {
    let end = start + P;
    let stop = ends[end - 1].next_multiple_of(BLOCK);
    let mut inverses = [0.0; P];
    for (at, inverse) in inverses.iter_mut().enumerate() {
        let pivot = start + at;
        let (above, below) = entries.split_at_mut((pivot + 1) * stride);
        let source = &above[pivot * stride..];
        *inverse = 1.0 / source[pivot];
        for (row, target) in (pivot + 1..end).zip(below.chunks_exact_mut(stride)) {
            let multiplier = source[row] * *inverse;
            let (target, _) = target[first_block(row)..stop].as_chunks_mut::<BLOCK>();
            let (source, _) = source[first_block(row)..stop].as_chunks::<BLOCK>();
            for (target, source) in target.iter_mut().zip(source) {
                for (t, s) in target.iter_mut().zip(source) {
                    *t -= multiplier * s;
                }
            }
        }
    }
    let (panel, rest) = entries.split_at_mut(end * stride);
    let panel = &panel[start * stride..];
    for (row, target) in (end..ends[end - 1]).zip(rest.chunks_exact_mut(stride)) {
        let (target, _) = target[first_block(row)..stop].as_chunks_mut::<BLOCK>();
        let mut multipliers = [0.0; P];
        let mut sources: [&[[f64; BLOCK]]; P] = [&[]; P];
        let mut q = 0;
        while q < P {
            let source = &panel[q * stride..][..stop];
            multipliers[q] = source[row] * inverses[q];
            let (blocks, _) = source[first_block(row)..].as_chunks::<BLOCK>();
            sources[q] = &blocks[..target.len()];
            q += 1;
        }
        for (at, target) in target.iter_mut().enumerate() {
            // Two chains of sums hide the latency.
            let mut sums = [[0.0; BLOCK]; 2];
            let mut q = 0;
            while q < P {
                let mut lane = 0;
                while lane < BLOCK {
                    sums[q % 2][lane] += multipliers[q] * sources[q][at][lane];
                    lane += 1;
                }
                q += 1;
            }
            let mut lane = 0;
            while lane < BLOCK {
                target[lane] -= sums[0][lane] + sums[1][lane];
                lane += 1;
            }
        }
    }
    P
}

#[inline(always)]
fn first_block(row: usize) -> usize {
    row - row % BLOCK
}
