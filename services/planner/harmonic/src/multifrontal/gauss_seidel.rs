//! Gauss-Seidel relaxation in extended range, for cells that `f64` factors cannot reach.
//!
//! A weight below the smallest `f64` becomes zero. This matters only where a cell takes its u from such a weight. In a long narrow
//! passage whose far end joins a much wider one, u grows again towards that end, but cells just behind the turning point depend on
//! the wide passage through weights of 1e-400. The values of their neighbours are right, and a few sweeps of relaxation in extended
//! range propagate them, because in such passages u changes by orders of magnitude a cell.

use super::breadth_first::{ABSENT, BreadthFirst};
use crate::domain::Domain;
use crate::scaled::Scaled;
use crate::store::Store;

/// Most sweeps, each in both directions.
const SWEEPS: usize = 200;

/// Largest relative change of a sweep that ends them.
const CONVERGED: f64 = 1e-7;

/// Relaxes `store` from the farthest cell to the nearest and back, until it converges.
pub(crate) fn relax(domain: &Domain, pass: &BreadthFirst, store: &mut Store) {
    for _ in 0..SWEEPS {
        let mut change = 0.0_f64;
        let places = pass.unknown();
        for place in places.clone().rev().chain(places) {
            let around = pass.neighbours(place).into_iter().filter(|&it| it != ABSENT);
            let sum = Scaled::sum(around.map(|place| store.u(pass.cell(place))));
            let index = pass.cell(place);
            let mean = 0.25 * sum.mantissa / (1.0 + domain.screening_coefficient(index));
            let u = Scaled::new(mean, sum.exponent);
            let before = store.u(index);
            change = change.max((before.relative_to(u.exponent) / u.mantissa - 1.0).abs());
            store.set(index, u.mantissa, u.exponent);
        }
        if change <= CONVERGED {
            break;
        }
    }
}
