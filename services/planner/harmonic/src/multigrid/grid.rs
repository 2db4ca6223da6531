//! Cells of a level, split by the parity of column and row into four planes.
//!
//! The cells of one colour are contiguous, so kernels run over whole rows with plain loads and
//! without masks. The even-even plane is the next coarser grid. A margin of zeros around each plane
//! makes bounds checks unnecessary.

use crate::real::Real;

/// Even column, even row: the cells of the next coarser level.
pub(super) const EE: usize = 0;
pub(super) const OE: usize = 1;
pub(super) const EO: usize = 2;
pub(super) const OO: usize = 3;

/// Plane of a cell, and its place there.
pub(super) type Place = (usize, usize);

/// Columns and rows from a cell to a neighbour.
pub(super) type Step = (isize, isize);
pub(super) const W: Step = (-1, 0);
pub(super) const E: Step = (1, 0);
pub(super) const N: Step = (0, -1);
pub(super) const S: Step = (0, 1);
pub(super) const NW: Step = (-1, -1);
pub(super) const NE: Step = (1, -1);
pub(super) const SW: Step = (-1, 1);
pub(super) const SE: Step = (1, 1);

/// Weights of the coarse cells west and east of odd-even cells, north and south of even-odd ones.
pub(super) type Weights<R> = [Vec<R>; 4];

/// Zeros before the first row; eight instead of one keep the rows aligned.
pub(super) const MARGIN: usize = 8;

/// Largest plane that a pass takes as one row, in values.
const SMALL: usize = 1 << 15;

/// Slices each row to `n` values from `start` on, mutably.
///
/// Known lengths let loops vectorise; `array::map` is not always inlined.
macro_rules! cut {
    ($start:expr, $n:expr, $($row:ident),+) => { $(let $row = &mut $row[$start..][..$n];)+ };
}
pub(super) use cut;

macro_rules! first {
    ($n:expr, $($row:ident),+) => { $(let $row = &$row[..$n];)+ };
}
pub(super) use first;

pub(super) type Planes<R> = [Vec<R>; 4];

#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub(super) struct Grid {
    pub width: usize,
    pub height: usize,
    /// Columns and rows of each plane.
    pub columns: usize,
    pub rows: usize,
    pub stride: usize,
    /// Rows of a plane that a pass takes as one row.
    ///
    /// A small level is one strip: work per row and partial vectors would cost more than the
    /// margins between rows. The margins stay zero, because their diagonals and weights are zero.
    pub strip_rows: usize,
    pub strips: usize,
}

impl Grid {
    pub(super) fn new(width: usize, height: usize) -> Self {
        let (columns, rows) = (width.div_ceil(2), height.div_ceil(2));
        // At least one zero separates two rows.
        let stride = (columns + 1).next_multiple_of(8);
        let strip_rows = if rows * stride <= SMALL { rows } else { 1 };
        let strips = rows / strip_rows;
        assert_eq!(strips * strip_rows, rows);
        Self { width, height, columns, rows, stride, strip_rows, strips }
    }

    pub(super) fn len(&self) -> usize {
        self.stride * (self.rows + 2) + MARGIN
    }

    #[inline(always)]
    pub(super) fn start(&self, row: usize) -> usize {
        (row + 1) * self.stride + MARGIN
    }

    #[inline(always)]
    pub(super) fn locate(&self, col: usize, row: usize) -> Place {
        ((col & 1) + 2 * (row & 1), self.start(row / 2) + col / 2)
    }

    #[inline(always)]
    pub(super) fn neighbour(&self, (plane, at): Place, (dx, dy): Step) -> Place {
        let (x, y) = ((plane & 1) as isize + dx, (plane >> 1) as isize + dy);
        let there = (x.rem_euclid(2) + 2 * y.rem_euclid(2)) as usize;
        let offset = y.div_euclid(2) * self.stride as isize + x.div_euclid(2);
        (there, at.wrapping_add_signed(offset))
    }

    #[inline(always)]
    pub(super) fn strip(&self, number: usize) -> (usize, usize) {
        let rows = self.strip_rows;
        (self.start(number * rows), (rows - 1) * self.stride + self.columns)
    }

    /// Returns the places of two consecutive strips in the buffers of a pass.
    ///
    /// Single rows alternate; the rows of a small level are contiguous.
    #[inline(always)]
    pub(super) fn buffered(&self, number: usize) -> [usize; 2] {
        let first = MARGIN + number % 2 * self.stride;
        [first, 2 * MARGIN + self.stride - first]
    }
}

/// Gives every row `len` zeros.
pub(super) fn zero_values<'a, R: Real>(rows: impl IntoIterator<Item = &'a mut Vec<R>>, len: usize) {
    for row in rows {
        if row.capacity() < len {
            // Fresh pages are already zero.
            *row = vec![R::default(); len];
            continue;
        }
        row.clear();
        row.resize(len, R::default());
    }
}

pub(super) fn clear<R: Real>(planes: &mut Planes<R>) {
    planes.iter_mut().for_each(|plane| plane.fill(R::default()));
}

#[derive(Debug, Default)]
pub(super) struct Scratch<R> {
    pub correction: Vec<R>,
    pub restricted: Vec<R>,
    pub change_ee: Vec<R>,
    pub change_oo: Vec<R>,
    pub residual_eo: Vec<R>,
    pub residual_oe: Vec<R>,
    pub residual_ee: Vec<R>,
}

impl<R: Real> Scratch<R> {
    pub(super) fn reset(&mut self, grid: &Grid) {
        let Self { correction, restricted, change_ee, change_oo, .. } = self;
        let Self { residual_eo, residual_oe, residual_ee, .. } = self;
        let len = (grid.strip_rows + 1) * grid.stride + 2 * MARGIN;
        zero_values([correction, restricted, change_ee, change_oo], len);
        zero_values([residual_eo, residual_oe, residual_ee], len);
    }

    #[inline(always)]
    pub(super) fn begin_correction(&mut self, next: &Grid, planes: &Planes<R>, share: R) {
        join_row(next, planes, 0, share, &mut self.correction[MARGIN..]);
    }

    #[inline(always)]
    pub(super) fn correction_below(
        &mut self,
        grid: &Grid,
        (next, planes): (&Grid, &Planes<R>),
        number: usize,
        share: R,
    ) -> (&[R], &[R]) {
        let [upper, lower] = grid.buffered(number);
        for row in 0..grid.strip_rows {
            let into = &mut self.correction[lower + row * grid.stride..];
            join_row(next, planes, number * grid.strip_rows + row + 1, share, into);
        }
        (&self.correction[upper..], &self.correction[lower..])
    }

    #[inline(always)]
    pub(super) fn split_restricted(
        &self,
        grid: &Grid,
        next: &Grid,
        planes: &mut Planes<R>,
        number: usize,
    ) {
        for row in 0..grid.strip_rows {
            let values = &self.restricted[row * grid.stride..];
            split_row(next, planes, number * grid.strip_rows + row, values);
        }
    }
}

/// Returns the weights on the coarse cells from `o` on in the surrounding cells: east, west, south
/// and north.
#[inline(always)]
pub(super) fn around<R>(
    [west, east, north, south]: &Weights<R>,
    o: usize,
    stride: usize,
) -> [&[R]; 4] {
    [&west[o..], &east[o - 1..], &north[o..], &south[o - stride..]]
}

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
    first!(n, w, a, v, b);
    for x in 0..n {
        out[x] += w[x] * a[x] + v[x] * b[x];
    }
}

#[inline(always)]
pub(super) fn split_row<R: Real>(grid: &Grid, planes: &mut Planes<R>, row: usize, values: &[R]) {
    let (start, n) = (grid.start(row / 2), grid.columns);
    let [ee, oe, eo, oo] = planes;
    let (even, odd) = if row.is_multiple_of(2) { (ee, oe) } else { (eo, oo) };
    cut!(start, n, even, odd);
    let values = &values[..2 * n];
    for ((even, odd), pair) in even.iter_mut().zip(odd).zip(values.chunks_exact(2)) {
        *even = pair[0];
        *odd = pair[1];
    }
}

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
