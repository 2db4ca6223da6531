//! Coarser level: nine-point equations for the correction of the finer one, solved from a zero
//! guess.
//!
//! The four planes are relaxed in turn. On the way down they start from zero, so each plane sees
//! only those before it. The residual on a plane is then the sum over the planes after it, without
//! the right-hand side or the diagonal.
//!
//! The odd-odd cells are last on the way down, so their residual is zero. They are first on the way
//! up, so they need neither a correction nor a stored interpolation.

use super::{
    grid::{
        E, EE, EO, Grid, MARGIN, N, NE, NW, OE, OO, Place, Planes, S, SE, SW, Scratch, Step, W,
        Weights, around, correct, zero_values,
    },
    kernels::{add_active, gather, relax, subtract, sum_weighted},
};
use crate::real::Real;

const ALL: [Step; 8] = [W, E, N, S, NW, NE, SW, SE];

#[derive(Debug, Default)]
pub(super) struct Coarse<R> {
    pub grid: Grid,
    pub u: Planes<R>,
    /// u of the first visit in a W-cycle.
    first_visit: Planes<R>,
    pub f: Planes<R>,
    /// 1 / diagonal; 0 if the cell is inactive.
    pub inverse: Planes<R>,
    /// Couplings (minus the matrix entries) to the east, south, south-east and south-west, by plane;
    /// the neighbours store the others.
    pub coupling: [Planes<R>; 4],
    pub weights: Weights<R>,
    scratch: Scratch<R>,
}

impl<R: Real> Coarse<R> {
    pub(super) fn reshape(&mut self, grid: Grid) {
        self.grid = grid;
        let planes = [&mut self.u, &mut self.first_visit, &mut self.f, &mut self.inverse];
        let planes = planes.into_iter().chain(&mut self.coupling).chain([&mut self.weights]);
        zero_values(planes.flatten(), grid.len());
        self.scratch.reset(&grid);
    }

    #[inline(always)]
    pub(super) fn descend(&mut self, next: &mut Self) {
        let (grid, m) = (self.grid, MARGIN);
        let mut scratch = std::mem::take(&mut self.scratch);
        scratch.residual_eo[..m + grid.stride].fill(R::default());
        for number in 0..=grid.strips {
            if number < grid.strips {
                let strip = grid.strip(number);
                self.relax(EE, strip, []);
                self.relax(OE, strip, [W, E]);
            }
            let Some(number) = number.checked_sub(1) else {
                continue;
            };
            let (o, n) = grid.strip(number);
            self.relax(EO, (o, n), [N, S, NW, NE, SW, SE]);
            self.relax(OO, (o, n), ALL);

            let Scratch { residual_eo, residual_oe, residual_ee, restricted, .. } = &mut scratch;
            let [above, here] = grid.buffered(number);
            gather(&mut residual_ee[m..][..n], &self.terms(EE, o, n, ALL));
            let steps = [N, S, NW, NE, SW, SE];
            gather(&mut residual_oe[m..][..n], &self.terms(OE, o, n, steps));
            gather(&mut residual_eo[here..][..n], &self.terms(EO, o, n, [W, E]));
            let (west, above, here) =
                (&residual_oe[m - 1..], &residual_eo[above..], &residual_eo[here..]);
            let (active, own) = (&self.inverse[EE][o..], &residual_ee[m..]);
            let weights = around(&self.weights, o, grid.stride);
            let values = [&west[1..], west, here, above];
            sum_weighted(&mut restricted[..n], active, own, weights, values);
            scratch.split_restricted(&grid, &next.grid, &mut next.f, number);
        }
        self.scratch = scratch;
    }

    #[inline(always)]
    pub(super) fn ascend(&mut self, next: &Self, share: R) {
        let grid = self.grid;
        let mut scratch = std::mem::take(&mut self.scratch);
        scratch.begin_correction(&next.grid, &next.u, share);
        for number in 0..=grid.strips {
            if number < grid.strips {
                let (o, n) = grid.strip(number);
                let (upper, lower) =
                    scratch.correction_below(&grid, (&next.grid, &next.u), number, share);
                add_active(&mut self.u[EE][o..][..n], &self.inverse[EE][o..], upper);
                correct(&mut self.u, &self.weights, (upper, lower), o, n);
            }
            if number > 0 {
                for plane in [OO, EO, OE, EE] {
                    self.relax(plane, grid.strip(number - 1), ALL);
                }
            }
        }
        self.scratch = scratch;
    }

    /// Keeps u of the first visit and makes its residual the right-hand side of the second.
    #[inline(always)]
    pub(super) fn begin_second_visit(&mut self) {
        for plane in [EE, OE, EO, OO] {
            for number in 0..self.grid.strips {
                let (o, n) = self.grid.strip(number);
                let mut f = std::mem::take(&mut self.f[plane]);
                let terms = self.terms(plane, o, n, ALL);
                let (u, inverse) = (&self.u[plane][o..][..n], &self.inverse[plane][o..][..n]);
                subtract(&mut f[o..][..n], u, inverse, &terms);
                self.f[plane] = f;
            }
        }
        // The next descent overwrites all of u.
        std::mem::swap(&mut self.first_visit, &mut self.u);
    }

    pub(super) fn end_second_visit(&mut self) {
        for (u, first) in self.u.iter_mut().zip(&self.first_visit) {
            for (u, &first) in u.iter_mut().zip(first) {
                *u += first;
            }
        }
    }

    /// Relaxes `n` places of a plane from `o`: u = (f + couplings times u at `steps`) / diagonal.
    #[inline(always)]
    fn relax<const COUNT: usize>(
        &mut self,
        plane: usize,
        (o, n): (usize, usize),
        steps: [Step; COUNT],
    ) {
        let mut row = std::mem::take(&mut self.u[plane]);
        let terms = self.terms(plane, o, n, steps);
        let f = &self.f[plane][o..][..n];
        let inverse = &self.inverse[plane][o..][..n];
        relax(&mut row[o..][..n], f, inverse, &terms);
        self.u[plane] = row;
    }

    #[inline(always)]
    fn terms<const COUNT: usize>(
        &self,
        plane: usize,
        o: usize,
        n: usize,
        steps: [Step; COUNT],
    ) -> [(&[R], &[R]); COUNT] {
        // `map` is not always inlined, and this loop runs for every row.
        let mut terms: [(&[R], &[R]); COUNT] = [(&[], &[]); COUNT];
        for (term, &step) in terms.iter_mut().zip(&steps) {
            *term = self.term(plane, o, n, step);
        }
        terms
    }

    #[inline(always)]
    fn term(&self, plane: usize, o: usize, n: usize, step: Step) -> (&[R], &[R]) {
        let (there, at) = self.grid.neighbour((plane, o), step);
        (self.couplings((plane, o), step, n), &self.u[there][at..][..n])
    }

    /// Returns the couplings of `n` cells with their neighbours at `step`.
    #[inline(always)]
    pub(super) fn couplings(&self, from: Place, step: Step, n: usize) -> &[R] {
        let is_stored_here = step.1 > 0 || step == E;
        let (plane, at) = if is_stored_here { from } else { self.grid.neighbour(from, step) };
        let direction = match step {
            E | W => 0,
            S | N => 1,
            SE | NW => 2,
            _ => 3,
        };
        &self.coupling[direction][plane][at..][..n]
    }
}
