//! Gauss-Seidel relaxation in extended range, for cells beyond the range of `f64` factors.
//!
//! A weight below the smallest `f64` becomes zero. This matters in a long narrow passage whose far
//! end joins a much wider one. u grows again towards that end, but cells just behind the turning
//! point depend on it through weights of 1e-400.
//!
//! The values of their neighbours are right. A few sweeps in extended range propagate them, because
//! u changes by orders of magnitude per cell there.

use super::breadth_first::{ABSENT, BreadthFirst};
use crate::{Domain, Scaled, store::Store};

/// Limit of sweeps, each in both directions.
const SWEEPS: usize = 200;

/// Largest relative change in the last sweep.
const CONVERGED: f64 = 1e-7;

/// Relaxes u of `store` from the farthest cell to the nearest and back until it converges.
pub(crate) fn relax(domain: &Domain, pass: &BreadthFirst, store: &Store) -> Store {
    let cells = 0..domain.blocked().len();
    let mut u: Vec<Scaled> = cells.map(|index| store.u(index)).collect();
    for _ in 0..SWEEPS {
        let mut change = 0.0_f64;
        let places = pass.unknown();
        for place in places.clone().rev().chain(places) {
            let around = pass.neighbours(place).into_iter().filter(|&it| it != ABSENT);
            let sum = Scaled::sum(around.map(|place| u[pass.cell(place)]));
            let cell = pass.cell(place);
            let mean = 0.25 * sum.mantissa / (1.0 + domain.screening_of(cell));
            let (new, own) = (Scaled::new(mean, sum.exponent), &mut u[cell]);
            change = change.max((own.relative_to(new.exponent) / new.mantissa - 1.0).abs());
            *own = new;
        }
        if change <= CONVERGED {
            break;
        }
    }
    Store::of(domain.blocked(), u.into_iter())
}
