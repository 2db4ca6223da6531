//! A level's cells, split by the parity of column and row into four planes.
//!
//! The cells of one colour are side by side in a plane, so every kernel runs over whole rows with plain loads and no
//! masks; the even-even plane is the next coarser grid. Around each plane is a margin of zeros, so that no kernel asks
//! whether a neighbour exists.

use crate::real::Real;

/// Even column, even row: the cells of the next coarser level.
pub(super) const EE: usize = 0;
pub(super) const OE: usize = 1;
pub(super) const EO: usize = 2;
pub(super) const OO: usize = 3;

/// Weights of the coarse cells to the west and east in each odd-even cell, and to the north and south in each even-odd cell.
pub(super) type Weights<R> = [Vec<R>; 4];

/// Zeros before the first row; one would do, eight keep the rows aligned.
pub(super) const MARGIN: usize = 8;

/// Largest plane that is gone through as one row, in values.
const SMALL: usize = 1 << 15;

/// Makes each of these rows `n` of its values from `start` on, to be written. It is a macro because loops are vectorised only where the
/// lengths of their rows are known, and `array::map` is not always inlined.
macro_rules! cut {
    ($start:expr, $n:expr, $($row:ident),+) => { $(let $row = &mut $row[$start..][..$n];)+ };
}
pub(super) use cut;

/// A value for each cell, by plane.
pub(super) type Planes<R> = [Vec<R>; 4];

#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub(super) struct Grid {
    pub width: usize,
    pub height: usize,
    /// Columns and rows of each plane.
    pub columns: usize,
    pub rows: usize,
    /// Values from one row of a plane to the next.
    pub stride: usize,
}

impl Grid {
    pub(super) fn new(width: usize, height: usize) -> Self {
        let (columns, rows) = (width.div_ceil(2), height.div_ceil(2));
        Self {
            width,
            height,
            columns,
            rows,
            // There is at least one zero between rows.
            stride: (columns + 1).next_multiple_of(8),
        }
    }

    /// Values of a plane with its margin.
    pub(super) fn len(&self) -> usize {
        self.stride * (self.rows + 2) + MARGIN
    }

    #[inline(always)]
    pub(super) fn start(&self, row: usize) -> usize {
        (row + 1) * self.stride + MARGIN
    }

    #[inline(always)]
    pub(super) fn locate(&self, col: usize, row: usize) -> (usize, usize) {
        ((col & 1) + 2 * (row & 1), self.start(row / 2) + col / 2)
    }

    /// The number of cells of a plane from its first to its last with the margins between rows, if the level is small. The planes of a
    /// small level are processed as a single row, because the work for each row and the partial vectors at its end would cost more
    /// than the margins. The margins stay zero, because their diagonals and weights are zero. The results are equal either way.
    #[inline(always)]
    pub(super) fn span(&self) -> Option<usize> {
        (self.rows * self.stride <= SMALL)
            .then(|| self.rows.saturating_sub(1) * self.stride + self.columns)
    }

    /// Makes `planes` the planes of this level, filled with zeros.
    pub(super) fn reset<'a, R: Real>(&self, planes: impl IntoIterator<Item = &'a mut Vec<R>>) {
        for plane in planes {
            if plane.capacity() < self.len() {
                // Fresh pages are already zero.
                *plane = vec![R::default(); self.len()];
                continue;
            }
            plane.clear();
            plane.resize(self.len(), R::default());
        }
    }
}

/// Row buffers of a pass over a level, reused between passes.
#[derive(Debug, Default)]
pub(super) struct Scratch<R> {
    /// Rows of the next level in column order.
    pub upper: Vec<R>,
    pub lower: Vec<R>,
    pub restricted: Vec<R>,
    /// Changes of even-even and odd-odd cells in the last two rows.
    pub change_ee: [Vec<R>; 2],
    pub change_oo: [Vec<R>; 2],
    /// Residuals of even-odd cells in the last two rows, and of odd-even and even-even cells in the last row.
    pub residual_eo: [Vec<R>; 2],
    pub residual_oe: Vec<R>,
    pub residual_ee: Vec<R>,
}

/// Planes of a pass over a small level, margins included, reused between passes.
#[derive(Debug, Default)]
pub(super) struct Whole<R> {
    /// The correction of the even-even cells on the way up, their residual on the way down.
    pub transfer: Vec<R>,
    /// Changes of even-even and odd-odd cells, on the finest level.
    pub change_ee: Vec<R>,
    pub change_oo: Vec<R>,
    pub residual_oe: Vec<R>,
    pub residual_eo: Vec<R>,
    pub residual_ee: Vec<R>,
}

impl<R: Real> Whole<R> {
    /// Makes these planes of zeros; none on a large level.
    pub(super) fn reset(&mut self, grid: &Grid) {
        let Self { transfer, change_ee, change_oo, residual_oe, residual_eo, residual_ee } = self;
        let planes = [transfer, change_ee, change_oo, residual_oe, residual_eo, residual_ee];
        if grid.span().is_some() {
            return grid.reset(planes);
        }
        planes.into_iter().for_each(|plane| *plane = Vec::new());
    }
}

/// Reads all rows of `next`, the level after that of `grid`, times `share`, into one of its planes.
#[inline(always)]
pub(super) fn join<R: Real>(
    grid: &Grid,
    next: &Grid,
    planes: &Planes<R>,
    share: R,
    into: &mut [R],
) {
    for y in 0..grid.rows {
        join_row(next, planes, y, share, &mut into[grid.start(y)..]);
    }
}

/// Writes a plane of the level of `grid` to all rows of the level `next`.
#[inline(always)]
pub(super) fn split<R: Real>(grid: &Grid, next: &Grid, planes: &mut Planes<R>, from: &[R]) {
    for y in 0..grid.rows {
        split_row(next, planes, y, &from[grid.start(y)..]);
    }
}

/// The weights on the coarse cells from place `o` on in the cells around them: to the east, west, south and north.
#[inline(always)]
pub(super) fn around<R>(
    [west, east, north, south]: &Weights<R>,
    o: usize,
    stride: usize,
) -> [&[R]; 4] {
    [&west[o..], &east[o - 1..], &north[o..], &south[o - stride..]]
}

/// Adds a coarse correction to `n` cells from `o` on of the odd-even and even-odd planes.
#[inline(always)]
pub(super) fn correct<R: Real>(
    u: &mut Planes<R>,
    [west, east, north, south]: &Weights<R>,
    (upper, lower): (&[R], &[R]),
    o: usize,
    n: usize,
) {
    add_products(&mut u[OE][o..][..n], (&west[o..], upper), (&east[o..], &upper[1..]));
    add_products(&mut u[EO][o..][..n], (&north[o..], upper), (&south[o..], lower));
}

#[inline(always)]
fn add_products<R: Real>(out: &mut [R], (w, a): (&[R], &[R]), (v, b): (&[R], &[R])) {
    let n = out.len();
    let (w, a, v, b) = (&w[..n], &a[..n], &v[..n], &b[..n]);
    for x in 0..n {
        out[x] += w[x] * a[x] + v[x] * b[x];
    }
}

impl<R: Real> Scratch<R> {
    /// Makes all rows zero, and as long as `grid` and `next` need them.
    pub(super) fn reset(&mut self, grid: &Grid, next: &Grid) {
        let reset = |row: &mut Vec<R>, len: usize| {
            row.clear();
            row.resize(len, R::default());
        };
        for row in [&mut self.upper, &mut self.lower, &mut self.restricted] {
            reset(row, 2 * next.columns + 2);
        }
        let pairs =
            self.change_ee.iter_mut().chain(&mut self.change_oo).chain(&mut self.residual_eo);
        for row in pairs.chain([&mut self.residual_oe, &mut self.residual_ee]) {
            reset(row, grid.stride + MARGIN);
        }
    }
}

/// Writes row `row` of a level, given in column order, to the planes.
#[inline(always)]
pub(super) fn split_row<R: Real>(grid: &Grid, planes: &mut Planes<R>, row: usize, values: &[R]) {
    let start = grid.start(row / 2);
    let (first, second) = planes.split_at_mut(2);
    let pair = if row.is_multiple_of(2) { first } else { second };
    let (even, odd) = pair.split_at_mut(1);
    let even = &mut even[0][start..start + grid.columns];
    let odd = &mut odd[0][start..start + grid.columns];
    let values = &values[..2 * grid.columns];
    for ((even, odd), pair) in even.iter_mut().zip(odd).zip(values.chunks_exact(2)) {
        *even = pair[0];
        *odd = pair[1];
    }
}

/// Reads row `row` of a level from the planes, times `share`, in column order; zeros beyond the last row.
#[inline(always)]
pub(super) fn join_row<R: Real>(
    grid: &Grid,
    planes: &Planes<R>,
    row: usize,
    share: R,
    values: &mut [R],
) {
    let values = &mut values[..2 * grid.columns];
    if row >= grid.height {
        values.fill(R::default());
        return;
    }
    let start = grid.start(row / 2);
    let first = 2 * (row & 1);
    let even = &planes[first][start..start + grid.columns];
    let odd = &planes[first + 1][start..start + grid.columns];
    for ((even, odd), pair) in even.iter().zip(odd).zip(values.chunks_exact_mut(2)) {
        pair[0] = share * *even;
        pair[1] = share * *odd;
    }
}
