//! Couplings of the equations of a level, as the set-up reads them.
//!
//! On the finest level, couplings between free cells are 1 and diagonal neighbours are uncoupled.
//! Other levels store all couplings. A type per kind lets generic loops skip those of 1 or 0. A
//! loop that loads all couplings takes 30 % longer for the whole set-up.

use super::{
    coarse::Coarse,
    finest::Finest,
    grid::{Grid, Place, Planes, Step, Weights},
};
use crate::real::Real;

pub(super) trait Couplings<R: Real>: Copy {
    fn times(self, x: usize, value: R) -> R;

    #[inline(always)]
    fn at(self, x: usize) -> R {
        self.times(x, R::ONE)
    }
}

impl<R: Real> Couplings<R> for &[R] {
    #[inline(always)]
    fn times(self, x: usize, value: R) -> R {
        self[x] * value
    }
}

/// Couplings to the neighbours with these inverse diagonals: 1 if a neighbour is active.
#[derive(Clone, Copy)]
struct IfActive<'a, R>(&'a [R]);

impl<R: Real> Couplings<R> for IfActive<'_, R> {
    #[inline(always)]
    fn times(self, x: usize, value: R) -> R {
        self.0[x].is_active() * value
    }
}

#[derive(Clone, Copy)]
struct AllOne;

impl<R: Real> Couplings<R> for AllOne {
    #[inline(always)]
    fn times(self, _: usize, value: R) -> R {
        value
    }
}

#[derive(Clone, Copy)]
struct NoCouplings;

impl<R: Real> Couplings<R> for NoCouplings {
    #[inline(always)]
    fn times(self, _: usize, _: R) -> R {
        R::default()
    }
}

/// Level whose equations make those of the next.
///
/// Couplings are those of `n` cells from a place on with their neighbours at `step`.
pub(super) trait Level<R: Real> {
    fn grid(&self) -> Grid;
    /// Returns 1 / diagonal; 0 if the cell is inactive.
    fn inverse(&self) -> &Planes<R>;
    fn weights(&self) -> &Weights<R>;
    fn weights_mut(&mut self) -> &mut Weights<R>;

    fn along(&self, from: Place, step: Step, n: usize) -> impl Couplings<R>;
    /// Returns the couplings between odd-odd cells and others, for products that vanish in inactive
    /// odd-odd cells.
    fn across(&self, from: Place, step: Step, n: usize) -> impl Couplings<R>;
    fn diagonal(&self, from: Place, step: Step, n: usize) -> impl Couplings<R>;
}

macro_rules! fields {
    () => {
        fn grid(&self) -> Grid {
            self.grid
        }

        fn inverse(&self) -> &Planes<R> {
            &self.inverse
        }

        fn weights(&self) -> &Weights<R> {
            &self.weights
        }

        fn weights_mut(&mut self) -> &mut Weights<R> {
            &mut self.weights
        }
    };
}

impl<R: Real> Level<R> for Finest<R> {
    fields!();

    #[inline(always)]
    fn along(&self, from: Place, step: Step, n: usize) -> impl Couplings<R> {
        let (plane, at) = self.grid.neighbour(from, step);
        IfActive(&self.inverse[plane][at..][..n])
    }

    #[inline(always)]
    fn across(&self, _: Place, _: Step, _: usize) -> impl Couplings<R> {
        AllOne
    }

    #[inline(always)]
    fn diagonal(&self, _: Place, _: Step, _: usize) -> impl Couplings<R> {
        NoCouplings
    }
}

impl<R: Real> Level<R> for Coarse<R> {
    fields!();

    #[inline(always)]
    fn along(&self, from: Place, step: Step, n: usize) -> impl Couplings<R> {
        self.couplings(from, step, n)
    }

    #[inline(always)]
    fn across(&self, from: Place, step: Step, n: usize) -> impl Couplings<R> {
        self.couplings(from, step, n)
    }

    #[inline(always)]
    fn diagonal(&self, from: Place, step: Step, n: usize) -> impl Couplings<R> {
        self.couplings(from, step, n)
    }
}
