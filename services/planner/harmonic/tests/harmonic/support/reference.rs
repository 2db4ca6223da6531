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

/// Returns the share of the reachable cells from which steepest ascent ends at the target.
pub(crate) fn follow(field: &Field) -> f64 {
    let width = field.width();
    let cell = |index: usize| Cell::new(index % width, index / width);
    // Whether the walk from each cell arrives, once known.
    let mut arrives = vec![None; width * field.height()];
    arrives[field.target().row * width + field.target().col] = Some(true);
    let (mut arrived, mut all) = (0_usize, 0_usize);
    for start in (0..arrives.len()).filter(|&index| field.is_reachable(cell(index))) {
        let mut path = Vec::new();
        let mut here = start;
        let result = loop {
            if let Some(known) = arrives[here] {
                break known;
            }
            // A walk that meets itself never arrives, so the cell counts as not arriving until
            // proven.
            arrives[here] = Some(false);
            path.push(here);
            let u = |index: usize| field.u(cell(index));
            here = around(width, field.height(), here)
                .into_iter()
                .flatten()
                .fold(here, |best, next| if u(next) > u(best) { next } else { best });
        };
        for index in path {
            arrives[index] = Some(result);
        }
        arrived += usize::from(arrives[start] == Some(true));
        all += 1;
    }
    arrived as f64 / all.max(1) as f64
}
