//! Verification that every field passes before the solver returns it.
//!
//! The crate page lists the checks. A free cell of u = 0 beside one of u > 0 also fails. The target
//! is then the only local maximum, so the cells of u > 0 form one component. They are exactly the
//! cells that can reach the target, and no search is needed.
//!
//! Residuals of one sign act like screening with that coefficient. In a wide hall, 1e-4 turns most
//! directions. Their sum over a tile is therefore compared with the curvature of the field. With
//! screening k, laplacian u = 4 k u; and laplacian (ln u) contains (|grad u| / u)^2.

mod cells;
mod rows;
mod tiles;

use std::{num::NonZeroUsize, ops::Range};

use crate::{Domain, Method, real::Real, simd::Simd, store::Store};

use cells::Cells;

use rows::{Rows, ScaledRows, Window};

use tiles::{TILE, Tiles};

pub(crate) use cells::Check;

/// Result of the verification.
#[derive(Clone, Debug, PartialEq)]
pub struct Verification {
    /// Largest |u - mean / (1 + k)| / u over the reachable cells except the target, without unit.
    pub worst_residual: f64,
    /// Largest share of the curvature that residuals of one sign explain, over tiles of 64 x 64
    /// cells.
    ///
    /// A share is 4 |sum of the relative residuals| / sum of (|grad u| / u)^2.
    pub worst_tile: f64,
    /// Method that computed the field.
    pub method: Method,
    /// Number of free cells that can reach the target, including the target.
    pub reachable: usize,
}

/// Least cells for a further thread, which takes some ten microseconds to start.
const CELLS_PER_THREAD: usize = 1 << 18;

/// Checks every cell of a field; the number of threads does not change the result.
pub(crate) fn check(domain: &Domain, store: &Store, threads: NonZeroUsize) -> Check {
    check_above(domain, store, threads, 0.0)
}

/// Checks the cells whose stored value is above `floor`.
pub(crate) fn check_above(
    domain: &Domain,
    store: &Store,
    threads: NonZeroUsize,
    floor: f64,
) -> Check {
    match store {
        Store::Single(values) => in_strips(domain, threads, |rows| {
            check_plain(domain.width(), values, rows, floor, weights_of(domain))
        }),
        Store::Double { values, .. } => in_strips(domain, threads, |rows| {
            check_plain(domain.width(), values, rows, floor, weights_of(domain))
        }),
        Store::Extended { mantissas, exponents } => {
            in_strips(domain, threads, |rows| check_extended(domain, mantissas, exponents, rows))
        }
    }
}

fn in_strips(
    domain: &Domain,
    threads: NonZeroUsize,
    check: impl Fn(Range<usize>) -> Check + Sync,
) -> Check {
    let height = domain.height();
    let strips = threads.get().min(domain.blocked().len() / CELLS_PER_THREAD).max(1);
    if strips == 1 {
        return check(0..height);
    }
    // Strips consist of whole tiles, so no sum depends on the number of strips.
    let start = |strip: usize| (height * strip / strips).next_multiple_of(TILE).min(height);
    let rows = |strip: usize| start(strip)..start(strip + 1);
    let check = &check;
    std::thread::scope(|scope| {
        let others: Vec<_> =
            (1..strips).map(|strip| scope.spawn(move || check(rows(strip)))).collect();
        let first = check(rows(0));
        // A thread that panicked has verified nothing.
        let failed = Check { worst_residual: f64::INFINITY, ..Check::default() };
        others.into_iter().map(|other| other.join().unwrap_or(failed)).fold(first, Check::and)
    })
}

fn check_plain<R: Real>(
    width: usize,
    values: &[R],
    strip: Range<usize>,
    floor: f64,
    set_weights: impl Fn(usize, &mut [R]),
) -> Check {
    let row_of = |row: usize| values.get(row * width..(row + 1) * width);
    check_rows(values, Cells::above(width, floor), Rows::new(width), row_of, strip, set_weights)
}

fn check_extended(
    domain: &Domain,
    mantissas: &[f64],
    exponents: &[i32],
    strip: Range<usize>,
) -> Check {
    let width = domain.width();
    let row_of = |row: usize| {
        let cells = row * width..(row + 1) * width;
        mantissas.get(cells.clone()).zip(exponents.get(cells))
    };
    let cells = Cells::above(width, 0.0);
    check_rows(mantissas, cells, ScaledRows::new(width), row_of, strip, weights_of(domain))
}

/// Sets the weights of a row of `domain`; 0 at the target, where no equation holds.
fn weights_of<R: Real>(domain: &Domain) -> impl Fn(usize, &mut [R]) {
    let target = domain.target();
    move |row, weights| {
        domain.weights_of_row(row, weights);
        if row == target.row {
            weights[target.col] = R::default();
        }
    }
}

/// Checks the cells of a part of a map with a positive weight, 0.25 / (1 + k), and u above `floor`.
pub(crate) fn check_above_with<R: Real>(
    width: usize,
    values: &[R],
    weights: &[R],
    floor: f64,
) -> Check {
    let set =
        |row: usize, of_row: &mut [R]| of_row.copy_from_slice(&weights[row * width..][..width]);
    check_plain(width, values, 0..values.len() / width, floor, set)
}

/// Checks a strip of rows with wide vectors.
///
/// `raw` holds the stored values, `row_of` returns a row or `None` beyond the map, and
/// `set_weights` sets the weights of a row.
fn check_rows<'f, R: Real, W: Window<R>>(
    raw: &[R],
    mut cells: Cells<R>,
    mut rows: W,
    row_of: impl Fn(usize) -> Option<W::Row<'f>>,
    strip: Range<usize>,
    set_weights: impl Fn(usize, &mut [R]),
) -> Check {
    Simd::default().run(
        #[inline(always)]
        || {
            let width = cells.weights.len();
            let mut found = Check::default();
            assert!(strip.end * width <= raw.len());
            let mut tiles = Tiles::new(width);
            assert!(strip.start.is_multiple_of(TILE));
            rows.take(strip.start.checked_sub(1).and_then(&row_of));
            rows.take(row_of(strip.start));
            for row in strip.clone() {
                rows.take(row_of(row + 1));
                set_weights(row, &mut cells.weights);
                cells.check(&raw[row * width..][..width], rows.around(), &mut found);
                tiles.add_row(row, &cells.residuals, &cells.slopes);
            }
            found.worst_tile = tiles.finish();
            found
        },
    )
}

#[cfg(test)]
mod tests {
    use super::cells::{RESIDUAL_LIMIT, TILE_LIMIT};
    use super::*;
    use crate::{Cancellation, Cell, Field, Scaled, Screening, Solver, store::BLOCKED};

    /// Returns a hall of `side` x `side` cells with a box in it.
    fn hall(side: usize) -> Domain {
        let mut blocked = vec![false; side * side];
        for row in side / 2..side / 2 + side / 8 {
            blocked[row * side + side / 2..][..side / 8].fill(true);
        }
        Domain::new(side, side, blocked, Cell::new(side / 6, side / 5)).unwrap()
    }

    fn solve(domain: &Domain) -> Field {
        Solver::default().solve(domain, &Cancellation::new()).unwrap()
    }

    #[test]
    fn a_field_solved_with_screening_does_not_pass_for_one_without_though_its_residuals_are_small()
    {
        for (side, k) in [(512, 5e-6_f64), (512, 2e-4), (128, 2e-4)] {
            let domain = hall(side);
            let screened = domain.clone().with_screening(&Screening::cells(0.5 / k.sqrt()));
            let [wrong, right] = [&screened.unwrap(), &domain]
                .map(|solved| check(&domain, &solve(solved).store, NonZeroUsize::MIN));
            assert!(wrong.worst_residual < RESIDUAL_LIMIT || k > 1e-4, "{wrong:?}");
            assert!(wrong.worst_tile > TILE_LIMIT, "{wrong:?}");
            assert!(right.worst_tile < TILE_LIMIT / 10.0, "{right:?}");
        }
    }

    #[test]
    fn a_field_with_an_exponent_a_cell_is_checked_as_one_with_a_common_exponent_is() {
        let domain = hall(128);
        let store = solve(&domain).store;
        let u = (0..domain.blocked().len()).map(|index| store.u(index));
        for factor in [1.0, 1.001, 3.0, 0.0, f64::NAN, f64::INFINITY] {
            let stored = |value: fn(Scaled) -> f64| -> Vec<f64> {
                let values = u.clone().zip(domain.blocked());
                let values = values.map(|(u, blocked)| if *blocked { BLOCKED } else { value(u) });
                let mut values: Vec<f64> = values.collect();
                values[domain.index(Cell::new(90, 70))] *= factor;
                values
            };
            let common = Store::Double { values: stored(|u| u.relative_to(0)), exponent: 0 };
            let extended = Store::Extended {
                mantissas: stored(|u| u.mantissa),
                exponents: u.clone().map(|u| u.exponent).collect(),
            };
            let [common, extended] =
                [common, extended].map(|store| check(&domain, &store, NonZeroUsize::MIN));
            let counts = |check: Check| (check.local_maxima, check.unreached, check.reachable);
            assert_eq!(counts(common), counts(extended));
            // Two infinities or two NaN agree as well.
            let agree =
                |a: f64, b: f64| !a.is_finite() && !b.is_finite() || (a / b - 1.0).abs() < 1e-6;
            assert!(agree(common.worst_residual, extended.worst_residual));
            assert!(agree(common.worst_tile, extended.worst_tile));
            assert_eq!(common.holds(), factor == 1.0);
        }
    }
}
