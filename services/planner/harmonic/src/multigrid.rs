//! Multigrid with interpolation by the equations themselves, after Dendy's BoxMG.
//!
//! The next level takes every second column and row. Interpolation follows the equations, so it
//! stops at walls. The coarse equations are the Galerkin product, so corrections stay on their side
//! of a wall. The solution is therefore relatively right even where u is 1e-40. The set-up depends
//! on the map alone. The target is a source of inflow, and the result is divided by u there.

mod coarse;
mod coarsest;
mod couplings;
mod finest;
mod galerkin;
mod grid;
mod kernels;
mod sources;

use std::ops::Range;

use crate::{Cancellation, Cell, Domain, SolveError, real::Real, scaled::pow2, simd::Simd};

use coarse::Coarse;

use coarsest::Coarsest;

use couplings::Level;

use finest::{Finest, Source, Work};

use galerkin::Products;

use grid::Grid;

/// Cycles before the first check.
///
/// The first cycles leave some cells at zero, and these count as settled.
pub(crate) const FIRST_CHECK: usize = 3;

/// Factor by which a cycle divides residuals, at least.
const PER_CYCLE: f64 = 3.0;
/// Limit of cycles between a failed check and the next.
const BETWEEN_CHECKS: f64 = 4.0;

/// Cycle limits per precision: its range of u at 1.4 orders of magnitude per cycle, with a reserve.
pub(crate) const SINGLE_CYCLES: usize = 60;
pub(crate) const DOUBLE_CYCLES: usize = 450;

const SMOOTHING: usize = 2;

/// Levels visited twice, as in a W-cycle, counted from the first coarse one.
///
/// The inexact first visit leaves an error that reaches far into cells of much smaller u. These
/// levels have a sixteenth of the cells and fewer, so second visits are cheap. They save up to
/// every other cycle.
const VISITED_TWICE: Range<usize> = 1..3;

/// Factors of coarse corrections, on the finest level and between coarse ones.
///
/// Interpolation bends u too much, especially at doors. The correction that is best by energy is
/// therefore too small (Braess, "Towards algebraic multigrid for elliptic problems of second
/// order", 1995). In measurements, 1.2 and 1.07 save a quarter of the cycles. On small maps the
/// second factor is one, because they visit levels once and its powers would accumulate.
const OVERCORRECTION: f64 = 1.2;
const COARSE_OVERCORRECTION: f64 = 1.07;

/// Longest side of a small map, where second visits and sweeps cost more than they save.
const SMALL_SIDE: usize = 128;

/// Full sweeps per pass over the finest level of a large map.
///
/// Only the first reads from memory. Dead ends a few cells wide, too narrow for coarser levels,
/// need the others.
const SWEEPS: usize = 3;

const COARSEST_SIDE: usize = 5;

#[derive(Debug, Default)]
pub(crate) struct Multigrid<R> {
    finest: Finest<R>,
    coarse: Vec<Coarse<R>>,
    coarsest: Coarsest,
    /// Set-up products of all levels but the coarsest, finest first.
    products: Vec<Products<R>>,
    corrects: bool,
    /// Whether u falls so steeply that second visits save no cycle.
    is_steep: bool,
    /// Number of all cycles so far.
    pub cycles: usize,
    simd: Simd,
}

impl<R: Real> Multigrid<R> {
    /// Reshapes the levels and clears the equations.
    ///
    /// Memory is reused, because fresh pages from the system cost as much as several cycles.
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

    /// Sets the equations that depend on `rows` of the map on all levels.
    pub(crate) fn set_up_rows(&mut self, domain: &Domain, rows: Range<usize>) {
        self.is_steep = false;
        let finest = &mut self.finest;
        let (grid, width) = (finest.grid, domain.width());
        assert_eq!((grid.width, grid.height), (width, domain.height()));
        assert!(rows.end <= grid.height);
        let mut inverse = vec![R::default(); 2 * grid.columns];
        self.simd.run(
            #[inline(always)]
            || {
                for row in rows.clone() {
                    let blocked = &domain.blocked()[row * width..(row + 1) * width];
                    domain.weights_of_row(row, &mut inverse[..width]);
                    for (inverse, &blocked) in inverse.iter_mut().zip(blocked) {
                        *inverse = if blocked { R::default() } else { *inverse };
                    }
                    grid::split_row(&grid, &mut finest.inverse, row, &inverse);
                }
            },
        );
        self.set_up_levels(rows);
    }

    fn set_up_levels(&mut self, rows: Range<usize>) {
        assert_eq!(self.products.len(), self.coarse.len());
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

    /// Makes `target` the only inflow and starts from the solution of the coarsest level.
    pub(crate) fn start(&mut self, target: Cell) {
        let source = Source::of(&self.finest.grid, target, R::of(pow2(R::TOP)));
        self.finest.sources = vec![source];
        self.start_from_sources();
    }

    /// `guess` writes a row, with 2^TOP at the target.
    pub(crate) fn start_near(&mut self, target: Cell, mut guess: impl FnMut(usize, &mut [R])) {
        self.corrects = false;
        let finest = &mut self.finest;
        let grid = finest.grid;
        let mut buffer = vec![R::default(); 2 * grid.columns];
        for row in 0..grid.height {
            guess(row, &mut buffer[..grid.width]);
            grid::split_row(&grid, &mut finest.u, row, &buffer);
        }
        // This inflow satisfies the equation of the target; the sweeps relax the others.
        let u = |col: usize, row: usize| {
            if col >= grid.width || row >= grid.height {
                return R::default();
            }
            let (plane, at) = grid.locate(col, row);
            finest.inverse[plane][at].is_active() * finest.u[plane][at]
        };
        let Cell { col, row } = target;
        let around = u(col.wrapping_sub(1), row) + u(col + 1, row);
        let around = around + u(col, row.wrapping_sub(1)) + u(col, row + 1);
        let (plane, at) = grid.locate(col, row);
        let value = finest.inverse[plane][at].inverse() * finest.u[plane][at] - around;
        finest.sources = vec![Source::of(&grid, target, value)];
        grid::clear(&mut self.coarse[0].u);
    }

    /// Starts by full multigrid: each level is interpolated from the next and improved by a cycle.
    fn start_from_sources(&mut self) {
        self.corrects = false;
        grid::clear(&mut self.finest.u);
        sources::restrict(&self.finest, &mut self.coarse);
        let last = self.coarse.len() - 1;
        self.coarsest.solve(&mut self.coarse[last]);
        for level in (0..last).rev() {
            grid::clear(&mut self.coarse[level].u);
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

    /// Loads equations of another problem and starts from the solution of the coarsest level.
    ///
    /// `rows` gives 1 / diagonal, 0 for a cell that stays zero. Couplings of neighbours are 1.
    /// `is_steep` says that u falls within a few cells.
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
        finest.sources.extend(inflow.map(|(cell, value)| Source::of(&grid, cell, value)));
        finest.sources.sort_unstable_by_key(|source| (source.plane, source.row));
        self.set_up_levels(0..height);
        self.start_from_sources();
    }

    /// Runs until every cell has settled and `check` finds no fault, or for `most` cycles. `check`
    /// returns the largest residual as a multiple of its limit, if that is too large.
    pub(crate) fn converge(
        &mut self,
        (first_check, most): (usize, usize),
        cancellation: &Cancellation,
        mut check: impl FnMut(&mut Self) -> Option<f64>,
    ) -> Result<(), SolveError> {
        assert!(first_check <= most);
        let mut next_check = first_check;
        for cycle in 1..=most {
            cancellation.check()?;
            self.cycles += 1;
            let judged = cycle >= next_check;
            let settled = self.cycle(judged) == 0 && judged;
            if settled || cycle == most {
                let Some(excess) = check(self) else { break };
                let cycles = excess.ln() / PER_CYCLE.ln();
                next_check = cycle + cycles.clamp(1.0, BETWEEN_CHECKS) as usize;
            }
        }
        Ok(())
    }

    /// Runs a cycle and counts the cells that it unsettles, if `judged`; otherwise the count is 0.
    fn cycle(&mut self, judged: bool) -> usize {
        let sweeps = if self.corrects && self.is_large() { SWEEPS } else { 1 };
        let unsettled = self.pass(sweeps, true, judged);
        self.solve_level(0);
        self.corrects = true;
        unsettled
    }

    /// Solves on a coarse level from zero, by one cycle through the levels below, or two.
    fn solve_level(&mut self, level: usize) {
        self.visit(level);
        if self.is_large() && !self.is_steep && VISITED_TWICE.contains(&level) {
            self.second_visit(level);
        }
    }

    fn visit(&mut self, level: usize) {
        assert!(level < self.coarse.len());
        if level == self.coarse.len() - 1 {
            return self.coarsest.solve(&mut self.coarse[level]);
        }
        self.descend(level);
        self.solve_level(level + 1);
        let overcorrection = if self.is_large() { COARSE_OVERCORRECTION } else { 1.0 };
        self.ascend(level, R::of(overcorrection));
    }

    /// Solves for the residual of the first visit to a coarse level, and overwrites the right-hand
    /// side.
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

    /// Interpolates the last coarse correction and smooths the remaining error, so that u can be
    /// read.
    ///
    /// Near a saddle point the direction depends on the last digits.
    pub(crate) fn finish(&mut self) {
        self.pass(1 + SMOOTHING, false, false);
        grid::clear(&mut self.coarse[0].u);
    }

    fn pass(&mut self, sweeps: usize, descend: bool, judged: bool) -> usize {
        let (finest, next) = (&mut self.finest, &mut self.coarse[0]);
        let share = if self.corrects { OVERCORRECTION } else { 1.0 };
        let work = Work { share: R::of(share), sweeps, descend, judged };
        self.simd.run(
            #[inline(always)]
            || finest.pass(next, work),
        )
    }

    fn ascend(&mut self, level: usize, share: R) {
        let (fine, next) = self.coarse.split_at_mut(level + 1);
        let fine = &mut fine[level];
        self.simd.run(
            #[inline(always)]
            || fine.ascend(&next[0], share),
        );
    }

    /// Returns u of every cell, row by row, times 2^TOP / u(target); `blocked` in blocked cells.
    pub(crate) fn read(&self, target: Cell, blocked: R) -> Vec<R> {
        let grid = &self.finest.grid;
        let (plane, at) = grid.locate(target.col, target.row);
        let top = pow2(R::TOP);
        assert!(target.col < grid.width && target.row < grid.height);
        let mut values = vec![blocked; grid.width * grid.height];
        self.unload(R::of(top / self.finest.u[plane][at].wide()), &mut values);
        values[target.row * grid.width + target.col] = R::of(top);
        values
    }

    /// Writes u of the cells with an equation, row by row, times `scale`.
    pub(crate) fn unload(&self, scale: R, values: &mut [R]) {
        let grid = &self.finest.grid;
        let mut u = vec![R::default(); 2 * grid.columns];
        let mut inverse = u.clone();
        for (row, out) in values.chunks_exact_mut(grid.width).enumerate() {
            grid::join_row(grid, &self.finest.u, row, R::ONE, &mut u);
            grid::join_row(grid, &self.finest.inverse, row, R::ONE, &mut inverse);
            for ((out, u), inverse) in out.iter_mut().zip(&u).zip(&inverse) {
                // Unconverged cells may be below zero; the verification finds a zero there.
                let u = if *u > R::default() { *u * scale } else { R::default() };
                *out = if *inverse > R::default() { u } else { *out };
            }
        }
    }
}

/// Sets the interpolation to `fine` and the equations of `next` that depend on `rows` of cells of
/// `fine`.
///
/// Returns the rows of cells of `next` that were set.
fn set_up_next<R: Real>(
    fine: &mut impl Level<R>,
    next: &mut Coarse<R>,
    rows: Range<usize>,
    products: &mut Products<R>,
    simd: Simd,
) -> Range<usize> {
    let grid = fine.grid();
    assert_eq!((next.grid.width, next.grid.height), (grid.columns, grid.rows));
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
