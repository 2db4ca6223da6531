//! Multigrid with interpolation by the equations themselves (after Dendy's BoxMG).
//!
//! Every second column and row makes the next level. The interpolation follows the equations, so it stops at walls, and
//! the coarse equations are the Galerkin product, so corrections do not leak through them: that, and not a norm, is what
//! makes the solution relatively right in cells where u is 1e-40. The set-up depends on the map alone, the target is a
//! source of inflow in the solve, and u is divided by its own value there at the end.
//!
//! - [`grid`]: the layout in four parity planes.
//! - [`finest`], [`coarse`], [`coarsest`]: relaxation and transfer on the three kinds of level.
//! - [`galerkin`], [`couplings`]: the interpolation and the equations of a level from those of the finer one.
//! - [`sources`]: the inflow on the coarse levels.

mod coarse;
mod coarsest;
mod couplings;
mod finest;
mod galerkin;
mod grid;
mod kernels;
mod sources;
#[cfg(test)]
mod tests;

use std::ops::Range;

use crate::{Cancellation, Cell, Domain, SolveError, real::Real, scaled::pow2, simd::Simd};

use coarse::Coarse;

use coarsest::Coarsest;

use couplings::Level;

use finest::{Finest, Source, Work};

use galerkin::Products;

use grid::Grid;

/// A cell whose direction a coarse correction turns by more than this, radians, has not settled. The correction is applied, and
/// the next would be smaller by a factor of three or more, which leaves directions well within a degree.
const TOLERANCE: f64 = 0.02;

/// Cycles before the first check: the first ones have not reached every cell, and a cell that is still zero does not count
/// as unsettled.
pub(crate) const FIRST_CHECK: usize = 3;

/// A cycle divides residuals by at least this.
const PER_CYCLE: f64 = 3.0;
/// Most cycles between a check that failed and the next.
const BETWEEN_CHECKS: f64 = 4.0;

/// Most cycles in a precision: its range of u at 1.4 orders of magnitude a cycle, with a reserve.
pub(crate) const SINGLE_CYCLES: usize = 60;
pub(crate) const DOUBLE_CYCLES: usize = 450;

const SMOOTHING: usize = 2;

/// The levels visited twice each time, as in a W-cycle, counted from the first coarse one. One visit of the levels below is
/// not exact, and its error reaches far into cells where u is much smaller; here, on a sixteenth of the map's cells and on a
/// quarter of that, second visits are cheap, and save up to every other cycle.
const VISITED_TWICE: Range<usize> = 1..3;

/// The factors of coarse corrections, on the finest level and between coarse ones. Interpolation bends u more than a
/// solution is bent, at doors above all, so the correction that is best by energy is too small (Braess, "Towards algebraic
/// multigrid for elliptic problems of second order", 1995). Measured: 1.2 and 1.07 save a quarter of the cycles, 1.3 or 1.2
/// cost some on some maps. On small maps the second is one: their levels are visited once, and its powers would add up.
const OVERCORRECTION: f64 = 1.2;
const COARSE_OVERCORRECTION: f64 = 1.07;

/// The longer side of small maps is at most this. On them second visits and second sweeps save fewer cycles than they cost.
const SMALL_SIDE: usize = 128;

/// Full sweeps in a pass over the finest level of a large map: all but the first read no more from memory, and dead ends a few
/// cells wide, which the coarser levels do not resolve, need them.
const SWEEPS: usize = 3;

const COARSEST_SIDE: usize = 5;

/// The levels of one map, in one precision.
#[derive(Debug, Default)]
pub(crate) struct Multigrid<R> {
    finest: Finest<R>,
    coarse: Vec<Coarse<R>>,
    coarsest: Coarsest,
    /// The products for the set-up of the next level, for all levels but the coarsest, the finest first.
    products: Vec<Products<R>>,
    /// Whether the first coarse level holds a correction of u, and not a first guess or nothing.
    corrects: bool,
    /// Whether u falls so steeply that second visits save no cycle.
    is_steep: bool,
    simd: Simd,
}

impl<R: Real> Multigrid<R> {
    /// Levels for maps of this size, with no equations yet.
    pub(crate) fn new(width: usize, height: usize) -> Self {
        let mut levels = Self::default();
        levels.reshape(width, height);
        levels
    }

    /// Makes these levels for maps of another size, with no equations yet, in the memory they have: fresh pages from the system
    /// cost as much as several cycles.
    pub(crate) fn reshape(&mut self, width: usize, height: usize) {
        let mut grid = Grid::new(width, height);
        self.finest.reshape(grid);
        self.products.clear();
        loop {
            self.products.push(Products::new(&grid));
            grid = Grid::new(grid.columns, grid.rows);
            let level = self.products.len();
            self.coarse.resize_with(self.coarse.len().max(level), Coarse::default);
            self.coarse[level - 1].reshape(grid);
            if grid.width.max(grid.height) <= COARSEST_SIDE {
                return self.coarse.truncate(level);
            }
        }
    }

    /// Sets the equations that depend on `rows` of the map, and no others, on all levels.
    pub(crate) fn set_up_rows(&mut self, domain: &Domain, rows: Range<usize>) {
        self.is_steep = false;
        let finest = &mut self.finest;
        let width = domain.width();
        let mut weights = vec![R::default(); width];
        self.simd.run(
            #[inline(always)]
            || {
                for row in rows.clone() {
                    let blocked = &domain.blocked()[row * width..(row + 1) * width];
                    domain.weights_of_row(row, &mut weights);
                    finest.set_row(row, blocked, &weights);
                }
            },
        );
        self.set_up_levels(rows);
    }

    /// Interpolation and coarse equations, where they depend on `rows` of the finest level.
    fn set_up_levels(&mut self, rows: Range<usize>) {
        let (first, products) = (&mut self.coarse[0], &mut self.products[0]);
        let mut rows = set_up_next(&mut self.finest, first, rows, products, self.simd);
        for level in 1..self.coarse.len() {
            let (fine, next) = self.coarse.split_at_mut(level);
            let (fine, products) = (&mut fine[level - 1], &mut self.products[level]);
            rows = set_up_next(fine, &mut next[0], rows, products, self.simd);
        }
        if let Some(last) = self.coarse.last() {
            self.coarsest.set_up(last);
        }
    }

    /// Makes `target` the only inflow and starts from the coarsest level's solution.
    pub(crate) fn start(&mut self, target: Cell) {
        let (plane, at) = self.finest.grid.locate(target.col, target.row);
        let value = R::of(pow2(R::TOP));
        self.finest.sources = vec![Source { plane, row: target.row / 2, at, value }];
        self.start_from_sources();
    }

    /// Makes `target` the only inflow and starts from a first guess, given row by row with 2^TOP at the target.
    pub(crate) fn start_near(&mut self, target: Cell, mut guess: impl FnMut(usize, &mut [R])) {
        self.corrects = false;
        let finest = &mut self.finest;
        let grid = finest.grid;
        let mut buffer = vec![R::default(); 2 * grid.columns];
        for row in 0..grid.height {
            guess(row, &mut buffer[..grid.width]);
            grid::split_row(&grid, &mut finest.u, row, &buffer);
        }
        // The inflow that satisfies the target's own equation; the sweeps relax the others.
        let u = |col: Option<usize>, row: Option<usize>| match (col, row) {
            (Some(col), Some(row)) if col < grid.width && row < grid.height => {
                let (plane, at) = grid.locate(col, row);
                finest.inverse[plane][at].is_active() * finest.u[plane][at]
            }
            _ => R::default(),
        };
        let (col, row) = (target.col, target.row);
        let around = u(col.checked_sub(1), Some(row)) + u(Some(col + 1), Some(row));
        let around = around + u(Some(col), row.checked_sub(1)) + u(Some(col), Some(row + 1));
        let (plane, at) = grid.locate(col, row);
        let value = finest.inverse[plane][at].inverse() * finest.u[plane][at] - around;
        finest.sources = vec![Source { plane, row: row / 2, at, value }];
        for plane in &mut self.coarse[0].u {
            plane.fill(R::default());
        }
    }

    /// Starts from the coarser levels' solution for the inflow, each interpolated from the next and improved by a cycle (full
    /// multigrid).
    fn start_from_sources(&mut self) {
        self.corrects = false;
        for plane in &mut self.finest.u {
            plane.fill(R::default());
        }
        sources::restrict(&self.finest, &mut self.coarse);
        let last = self.coarse.len() - 1;
        self.coarsest.solve(&mut self.coarse[last]);
        for level in (0..last).rev() {
            for plane in &mut self.coarse[level].u {
                plane.fill(R::default());
            }
            self.ascend(level, R::ONE);
            if self.is_large() && level >= VISITED_TWICE.start {
                self.second_visit(level);
            }
        }
    }

    fn is_large(&self) -> bool {
        let Grid { width, height, .. } = self.finest.grid;
        width.max(height) > SMALL_SIDE
    }

    /// Loads equations other than a map's: for each row 1 / diagonal (0 for a cell that stays zero), and the inflow by cell.
    /// Every pair of neighbours is coupled by one. `is_steep` says that u falls within a few cells. Starts from the coarsest level's solution.
    pub(crate) fn load<'a>(
        &mut self,
        rows: impl Fn(usize) -> &'a [R],
        inflow: impl Iterator<Item = (Cell, R)>,
        is_steep: bool,
    ) {
        self.is_steep = is_steep;
        let finest = &mut self.finest;
        let (grid, width, height) = (finest.grid, finest.grid.width, finest.grid.height);
        let mut buffer = vec![R::default(); 2 * grid.columns];
        for row in 0..height {
            buffer[..width].copy_from_slice(rows(row));
            grid::split_row(&grid, &mut finest.inverse, row, &buffer);
        }
        finest.sources.clear();
        finest.sources.extend(inflow.map(|(cell, value)| {
            let (plane, at) = grid.locate(cell.col, cell.row);
            Source { plane, row: cell.row / 2, at, value }
        }));
        finest.sources.sort_unstable_by_key(|source| (source.plane, source.row));
        self.set_up_levels(0..height);
        self.start_from_sources();
    }

    /// u of every cell as it is, given row by row.
    pub(crate) fn unload(&self, mut row_is: impl FnMut(usize, &[R])) {
        let grid = &self.finest.grid;
        let mut buffer = vec![R::default(); 2 * grid.columns];
        for row in 0..grid.height {
            grid::join_row(grid, &self.finest.u, row, R::ONE, &mut buffer);
            row_is(row, &buffer[..grid.width]);
        }
    }

    /// Cycles until every cell has settled and `after` finds no fault, or `most` are done. `after` is called after each cycle, with
    /// true where the field is to be checked; it returns the largest residual as a multiple of its limit if that is too large.
    ///
    /// # Errors
    /// [`SolveError::Cancelled`].
    pub(crate) fn converge(
        &mut self,
        (first_check, most): (usize, usize),
        cancellation: &Cancellation,
        mut after: impl FnMut(&mut Self, bool) -> Option<f64>,
    ) -> Result<(), SolveError> {
        let mut next_check = first_check;
        for cycle in 1..=most {
            cancellation.check()?;
            let judged = (cycle >= next_check).then_some(TOLERANCE);
            let settled = self.cycle(judged) == 0 && judged.is_some();
            let checked = settled || cycle == most;
            match after(self, checked) {
                Some(excess) if checked => {
                    let cycles = excess.ln() / PER_CYCLE.ln();
                    next_check = cycle + cycles.clamp(1.0, BETWEEN_CHECKS) as usize;
                }
                None if checked => break,
                _ => {}
            }
        }
        Ok(())
    }

    /// Runs a cycle and counts the cells whose direction the correction turns by more than `tolerance`, radians; without a tolerance none.
    pub(crate) fn cycle(&mut self, tolerance: Option<f64>) -> usize {
        let sweeps = if self.corrects && self.is_large() { SWEEPS } else { 1 };
        let unsettled = self.pass(sweeps, true, tolerance);
        self.solve_level(0);
        self.corrects = true;
        unsettled
    }

    /// Solves on a coarse level, from zero, by one cycle through it and those below; on some it is followed by another.
    fn solve_level(&mut self, level: usize) {
        self.visit(level);
        // The coarsest level of a large map is none of these.
        if self.is_large() && !self.is_steep && VISITED_TWICE.contains(&level) {
            self.second_visit(level);
        }
    }

    /// Run a cycle from zero through a coarse level and the levels below.
    fn visit(&mut self, level: usize) {
        if level == self.coarse.len() - 1 {
            return self.coarsest.solve(&mut self.coarse[level]);
        }
        self.descend(level);
        self.solve_level(level + 1);
        let overcorrection = if self.is_large() { COARSE_OVERCORRECTION } else { 1.0 };
        self.ascend(level, R::of(overcorrection));
    }

    /// Solves for the residual that the first visit left on a coarse level. The right-hand side is overwritten.
    fn second_visit(&mut self, level: usize) {
        let fine = &mut self.coarse[level];
        self.simd.run(
            #[inline(always)]
            || fine.begin_second_visit(),
        );
        self.visit(level);
        self.coarse[level].end_second_visit();
    }

    fn descend(&mut self, level: usize) {
        let (fine, next) = self.coarse.split_at_mut(level + 1);
        let fine = &mut fine[level];
        self.simd.run(
            #[inline(always)]
            || fine.descend(&mut next[0]),
        );
    }

    /// Interpolates the last coarse correction to the finest level, for u to be read, and smoothes the error that leaves from
    /// cell to cell: near a saddle point the direction depends on the last digits. Cycles may follow.
    pub(crate) fn finish(&mut self) {
        self.pass(1 + SMOOTHING, false, None);
        for plane in &mut self.coarse[0].u {
            plane.fill(R::default());
        }
    }

    fn pass(&mut self, sweeps: usize, descend: bool, tolerance: Option<f64>) -> usize {
        let (finest, next) = (&mut self.finest, &mut self.coarse[0]);
        let share = if self.corrects { OVERCORRECTION } else { 1.0 };
        let work = Work { share: R::of(share), sweeps, descend, tolerance: tolerance.map(R::of) };
        self.simd.run(
            #[inline(always)]
            || finest.pass(next, work),
        )
    }

    /// Adds `share` of the next level's u to a coarse level and relaxes.
    fn ascend(&mut self, level: usize, share: R) {
        let (fine, next) = self.coarse.split_at_mut(level + 1);
        let fine = &mut fine[level];
        self.simd.run(
            #[inline(always)]
            || fine.ascend(&next[0], share),
        );
    }

    /// u of every cell, row by row, times 2^TOP over u(target); `blocked` where the map is.
    pub(crate) fn read(&self, target: Cell, blocked: R, into: &mut Vec<R>) {
        let grid = &self.finest.grid;
        let (plane, at) = grid.locate(target.col, target.row);
        let top = pow2(R::TOP);
        let scale = R::of(top / self.finest.u[plane][at].wide());
        into.clear();
        into.resize(grid.width * grid.height, R::default());
        let mut u = vec![R::default(); 2 * grid.columns];
        let mut inverse = u.clone();
        for (row, out) in into.chunks_exact_mut(grid.width).enumerate() {
            grid::join_row(grid, &self.finest.u, row, R::ONE, &mut u);
            grid::join_row(grid, &self.finest.inverse, row, R::ONE, &mut inverse);
            for ((out, u), inverse) in out.iter_mut().zip(&u).zip(&inverse) {
                // Cells that have not converged may be below zero; the verification finds a zero there.
                let u = if *u > R::default() { *u * scale } else { R::default() };
                *out = if *inverse > R::default() { u } else { blocked };
            }
        }
        into[target.row * grid.width + target.col] = R::of(top);
    }
}

/// Sets the interpolation to `fine` from `next` and the equations of `next`, where they depend on `rows` of the cells of `fine`; returns
/// the rows of the cells of `next` that were set.
fn set_up_next<R: Real>(
    fine: &mut impl Level<R>,
    next: &mut Coarse<R>,
    rows: Range<usize>,
    products: &mut Products<R>,
    simd: Simd,
) -> Range<usize> {
    let grid = fine.grid();
    // One row more on either side than the cells have neighbours in.
    let coarse_rows = |more: usize| {
        (rows.start / 2).saturating_sub(more)..(rows.end / 2 + more + 1).min(grid.rows)
    };
    simd.run(
        #[inline(always)]
        || {
            galerkin::interpolate(fine, coarse_rows(1));
            galerkin::coarsen(fine, next, coarse_rows(2), products);
        },
    );
    coarse_rows(2)
}
