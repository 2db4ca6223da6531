//! Checks of a field that share nothing with its solver.

use harmonic::{Cell, Domain, Field};

use super::around;

/// Returns the largest relative error of u in the equation of a reachable cell.
pub(crate) fn worst_residual(domain: &Domain, field: &Field) -> f64 {
    let width = domain.width();
    let cell = |index: usize| Cell::new(index % width, index / width);
    let is_solved =
        |&index: &usize| field.is_reachable(cell(index)) && cell(index) != domain.target();
    let error = |index: usize| {
        let own = field.u(cell(index));
        let relative = |there: usize| field.u(cell(there)).relative_to(own.exponent) / own.mantissa;
        let beside = around(width, domain.height(), index).into_iter().flatten();
        let sum: f64 = beside.filter(|&there| !domain.blocked()[there]).map(relative).sum();
        (sum / (4.0 * (1.0 + domain.screening_of(index))) - 1.0).abs()
    };
    (0..domain.blocked().len()).filter(is_solved).map(error).fold(0.0, f64::max)
}

/// Returns the angle between two vectors, degrees.
pub(crate) fn angle(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] * b[1] - a[1] * b[0]).atan2(a[0] * b[0] + a[1] * b[1]).abs().to_degrees()
}

/// Returns whether steepest ascent from every reachable cell ends at the target.
///
/// It climbs as long as a neighbour has a larger u, so it can only end elsewhere at a cell without
/// one.
pub(crate) fn leads_to_target(field: &Field) -> bool {
    let (width, height) = (field.width(), field.height());
    let cell = |index: usize| Cell::new(index % width, index / width);
    let climbs = |index: usize| {
        let mut beside = around(width, height, index).into_iter().flatten();
        beside.any(|next| field.u(cell(next)) > field.u(cell(index)))
    };
    (0..width * height).all(|index| {
        !field.is_reachable(cell(index)) || cell(index) == field.target() || climbs(index)
    })
}
