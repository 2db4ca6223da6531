//! The verification every field passes before it is handed out.
//!
//! Of every cell two things are checked: the residual of its equation is small relative to its own u (a norm over the map
//! says nothing about cells where u is 1e-50), and one of its neighbours has a larger u, so steepest ascent from it ends at
//! the target. A free cell of u = 0 beside one of u > 0 fails too. So the cells of u > 0 are connected components without a
//! local maximum but the target, hence one component: exactly the cells that can reach the target. No search is needed.
//!
//! Small residuals are not enough for right directions: if all have one sign they act as screening of that coefficient
//! would, and in a wide hall a coefficient of 1e-4 turns most directions. What counts is their sum over many cells, beside
//! how much the field bends there anyhow: with screening k, laplacian u = 4 k u, and (|grad u| / u)^2 is what
//! laplacian (ln u) is made of. The ratio of both is limited in every tile of the map. That is no bound of angles; the
//! angles themselves are measured against exact solutions, on thousands of maps (`cargo bench`, `-- accuracy`).

use std::num::NonZeroUsize;
use std::ops::Range;

use crate::domain::Domain;
use crate::method::Method;
use crate::real::Real;
use crate::scaled::Scaled;
use crate::screening::Coefficients;
use crate::simd::Simd;
use crate::store::Store;

/// What was verified of a field, cell by cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Verification {
    /// The largest |u - mean / (1 + k)| / u over the reachable cells but the target.
    pub worst_residual: f64,
    /// The largest share of what bends the field that residuals of one sign account for, over tiles of 64 x 64 cells:
    /// 4 |sum of the relative residuals| over the sum of (|grad u| / u)^2.
    pub worst_tile: f64,
    /// How the field was computed.
    pub method: Method,
    /// Free cells from which the target can be reached, the target's own included.
    pub reachable: usize,
}

/// Largest componentwise relative residual of a published field.
const RESIDUAL_LIMIT: f64 = 2e-4;

/// Side of the tiles over which residuals are summed.
const TILE: usize = 64;

/// Largest [`Verification::worst_tile`] of a published field.
const TILE_LIMIT: f64 = 0.01;

/// Least cells for a thread of their own, which takes some ten microseconds to start.
const CELLS_PER_THREAD: usize = 1 << 18;

/// The result of a verification.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Check {
    /// Largest relative residual of the cells with u > 0 but the target.
    pub worst_residual: f64,
    /// As in [`Verification`].
    pub worst_tile: f64,
    /// Cells with u > 0, other than the target, that no neighbour exceeds.
    pub local_maxima: usize,
    /// Free cells with u = 0 beside one with u > 0.
    pub unreached: usize,
    /// Cells with u > 0.
    pub reachable: usize,
}

impl Check {
    /// The result for the cells of both.
    fn and(self, other: Self) -> Self {
        Self {
            worst_residual: self.worst_residual.max(other.worst_residual),
            worst_tile: self.worst_tile.max(other.worst_tile),
            local_maxima: self.local_maxima + other.local_maxima,
            unreached: self.unreached + other.unreached,
            reachable: self.reachable + other.reachable,
        }
    }

    /// The largest residual as a multiple of the limit.
    pub(crate) fn excess(&self) -> f64 {
        self.worst_residual / RESIDUAL_LIMIT
    }

    /// Whether the field may be handed out.
    pub(crate) fn holds(&self) -> bool {
        self.local_maxima == 0
            && self.unreached == 0
            && self.worst_residual <= RESIDUAL_LIMIT
            && self.worst_tile <= TILE_LIMIT
    }
}

/// Checks every cell of a field, on up to `threads` threads; the result does not depend on how many.
pub(crate) fn check(domain: &Domain, store: &Store, threads: NonZeroUsize) -> Check {
    let mut found = match store {
        Store::Single { values, .. } => {
            in_strips(domain, threads, |rows| check_plain(domain, values, rows))
        }
        Store::Double { values, .. } => {
            in_strips(domain, threads, |rows| check_plain(domain, values, rows))
        }
        Store::Extended {
            mantissas,
            exponents,
        } => in_strips(domain, threads, |rows| {
            check_extended(domain, mantissas, exponents, rows)
        }),
    };
    // The target is positive by construction and was left out.
    found.reachable += 1;
    found
}

/// Runs `check` on strips of rows, each on a thread of its own where that pays.
fn in_strips(
    domain: &Domain,
    threads: NonZeroUsize,
    check: impl Fn(Range<usize>) -> Check + Sync,
) -> Check {
    let height = domain.height();
    let strips = threads
        .get()
        .min(domain.blocked().len() / CELLS_PER_THREAD)
        .max(1);
    if strips == 1 {
        return check(0..height);
    }
    // Strips of whole tiles: so no sum depends on how many there are.
    let start = |strip: usize| (height * strip / strips).next_multiple_of(TILE).min(height);
    let rows = |strip: usize| start(strip)..start(strip + 1);
    let check = &check;
    std::thread::scope(|scope| {
        let others: Vec<_> = (1..strips)
            .map(|strip| scope.spawn(move || check(rows(strip))))
            .collect();
        let first = check(rows(0));
        // A thread that panicked has verified nothing.
        let failed = Check {
            worst_residual: f64::INFINITY,
            ..Check::default()
        };
        others
            .into_iter()
            .map(|other| other.join().unwrap_or(failed))
            .fold(first, Check::and)
    })
}

/// Checks rows of a field with one common exponent, with wide vectors.
fn check_plain<R: Real>(domain: &Domain, values: &[R], strip: Range<usize>) -> Check {
    Simd::default().run(
        #[inline(always)]
        || {
            let width = domain.width();
            let row_of = |row: usize| values.get(row * width..(row + 1) * width);
            let mut found = Check::default();
            let mut rows = Rows::new(width);
            let mut tiles = Tiles::new(width);
            rows.take(strip.start.checked_sub(1).and_then(row_of));
            rows.take(row_of(strip.start));
            for row in strip.clone() {
                rows.take(row_of(row + 1));
                rows.set_weights(domain, row);
                let raw = &values[row * width..(row + 1) * width];
                if row == domain.target().row {
                    rows.check(raw, 0..domain.target().col, &mut found);
                    rows.check(raw, domain.target().col + 1..width, &mut found);
                    rows.residuals[domain.target().col] = R::default();
                    rows.slopes[domain.target().col] = R::default();
                } else {
                    rows.check(raw, 0..width, &mut found);
                }
                tiles.add_row(row, &rows.residuals[..width], &rows.slopes[..width]);
            }
            found.worst_tile = tiles.finish();
            found
        },
    )
}

/// Checks a field given with one row or column of u around it, `width` cells wide without; `weights`, framed too, are
/// 0.25 / (1 + k), 0 where no equation holds.
pub(crate) fn check_framed(width: usize, values: &[f32], weights: &[f32]) -> Check {
    Simd::default().run(
        #[inline(always)]
        || {
            let framed = width + 2;
            let height = values.len() / framed - 2;
            let mut found = Check::default();
            let mut rows = Rows::new(framed);
            rows.take(values.get(..framed));
            rows.take(values.get(framed..2 * framed));
            for row in 0..height {
                rows.take(values.get((row + 2) * framed..(row + 3) * framed));
                rows.weights[..framed]
                    .copy_from_slice(&weights[(row + 1) * framed..(row + 2) * framed]);
                let raw = &values[(row + 1) * framed..(row + 2) * framed];
                rows.check(raw, 1..framed - 1, &mut found);
            }
            found
        },
    )
}

/// Three neighbouring rows of u with a zero at either end, blocked cells zero.
struct Rows<R> {
    above: Vec<R>,
    here: Vec<R>,
    below: Vec<R>,
    /// 0.25 / (1 + k) of each cell of the row.
    weights: Vec<R>,
    weights_set: bool,
    /// Relative residuals, with their signs, of the cells an equation holds for.
    residuals: Vec<R>,
    /// (|grad u| / u)^2 of the same.
    slopes: Vec<R>,
}

impl<R: Real> Rows<R> {
    fn new(width: usize) -> Self {
        let row = vec![R::default(); width + 2];
        Self {
            above: row.clone(),
            here: row.clone(),
            below: row.clone(),
            weights: row.clone(),
            weights_set: false,
            residuals: row.clone(),
            slopes: row,
        }
    }

    /// Moves one row on; `next` is the one that comes in below, none after the last.
    #[inline(always)]
    fn take(&mut self, next: Option<&[R]>) {
        std::mem::swap(&mut self.above, &mut self.here);
        std::mem::swap(&mut self.here, &mut self.below);
        let zero = R::default();
        let width = self.below.len() - 2;
        let below = &mut self.below[1..=width];
        match next {
            Some(next) => {
                for (to, &from) in below.iter_mut().zip(next) {
                    *to = if from > zero { from } else { zero };
                }
            }
            None => below.fill(zero),
        }
    }

    #[inline(always)]
    fn set_weights(&mut self, domain: &Domain, row: usize) {
        let width = domain.width();
        match domain.screening() {
            Coefficients::Uniform(k) if !self.weights_set => {
                self.weights.fill(R::of(0.25 / (1.0 + k)));
                self.weights_set = true;
            }
            Coefficients::Uniform(_) => {}
            Coefficients::PerCell(cells) => {
                for (weight, &k) in self
                    .weights
                    .iter_mut()
                    .zip(&cells[row * width..(row + 1) * width])
                {
                    *weight = R::of(0.25 / (1.0 + f64::from(k)));
                }
            }
        }
    }

    /// Checks the cells of `columns` of the middle row, `raw` as stored.
    #[inline(always)]
    fn check(&mut self, raw: &[R], columns: Range<usize>, found: &mut Check) {
        let (start, n) = (columns.start, columns.len());
        let zero = R::default();
        let raw = &raw[start..][..n];
        let (here, west, east) = (
            &self.here[start + 1..][..n],
            &self.here[start..][..n],
            &self.here[start + 2..][..n],
        );
        let (north, south) = (&self.above[start + 1..][..n], &self.below[start + 1..][..n]);
        let weights = &self.weights[start..][..n];
        let residuals = &mut self.residuals[start..][..n];
        let slopes = &mut self.slopes[start..][..n];
        let quarter = R::of(0.25);
        let larger = |a: R, b: R| if a > b { a } else { b };
        let (mut local_maxima, mut unreached, mut reachable) = (0_u32, 0_u32, 0_u32);
        for x in 0..n {
            let sum = (west[x] + east[x]) + (north[x] + south[x]);
            let best = larger(larger(west[x], east[x]), larger(north[x], south[x]));
            let positive = here[x] > zero;
            reachable += u32::from(positive);
            // A value that is no number is neither blocked nor positive: unreached.
            let blocked = raw[x] < zero;
            unreached += u32::from(!positive & !blocked & (sum > zero));
            let residual = here[x] - weights[x] * sum;
            let holds = positive & (weights[x] > zero);
            local_maxima += u32::from(holds & (best <= here[x]));
            let scale = if holds { R::ONE / here[x] } else { zero };
            residuals[x] = residual * scale;
            let (across, along) = ((east[x] - west[x]) * scale, (south[x] - north[x]) * scale);
            slopes[x] = quarter * (across * across + along * along);
        }
        // In lanes: a running maximum over floats is otherwise taken one by one.
        let mut worst = [zero; 16];
        let chunks = residuals.chunks_exact(16);
        for (lane, &residual) in worst.iter_mut().zip(chunks.remainder()) {
            *lane = larger(residual.size(), *lane);
        }
        for chunk in chunks {
            for (lane, &residual) in worst.iter_mut().zip(chunk) {
                *lane = larger(residual.size(), *lane);
            }
        }
        let worst = worst.into_iter().fold(zero, larger).wide();
        found.worst_residual = found.worst_residual.max(worst);
        found.local_maxima += local_maxima as usize;
        found.unreached += unreached as usize;
        found.reachable += reachable as usize;
    }
}

/// Sums over tiles of the map, one row of tiles at a time.
struct Tiles {
    /// Of the relative residuals with their signs, and of (|grad u| / u)^2.
    sums: Vec<[f64; 2]>,
    worst: f64,
}

impl Tiles {
    fn new(width: usize) -> Self {
        Self {
            sums: vec![[0.0; 2]; width.div_ceil(TILE)],
            worst: 0.0,
        }
    }

    /// Adds row `row` of the map; the first of a tile ends the tiles above.
    #[inline(always)]
    fn add_row<R: Real>(&mut self, row: usize, residuals: &[R], slopes: &[R]) {
        if row.is_multiple_of(TILE) {
            self.end_tiles();
        }
        let rows = residuals.chunks(TILE).zip(slopes.chunks(TILE));
        for ([residual, slope], (residuals, slopes)) in self.sums.iter_mut().zip(rows) {
            *residual += sum(residuals);
            *slope += sum(slopes);
        }
    }

    #[inline(always)]
    fn end_tiles(&mut self) {
        for sums in &mut self.sums {
            let [residual, slope] = std::mem::take(sums);
            if residual != 0.0 {
                // What is no number is not small.
                let share = 4.0 * residual.abs() / slope;
                self.worst = if share <= self.worst {
                    self.worst
                } else {
                    share
                };
            }
        }
    }

    #[inline(always)]
    fn finish(mut self) -> f64 {
        self.end_tiles();
        self.worst
    }
}

/// The sum in lanes, whose order is the same whatever the width of vectors.
#[inline(always)]
fn sum<R: Real>(values: &[R]) -> f64 {
    let mut lanes = [R::default(); 16];
    let chunks = values.chunks_exact(16);
    for (lane, &value) in lanes.iter_mut().zip(chunks.remainder()) {
        *lane += value;
    }
    for chunk in chunks {
        for (lane, &value) in lanes.iter_mut().zip(chunk) {
            *lane += value;
        }
    }
    lanes.into_iter().fold(0.0, |sum, lane| sum + lane.wide())
}

/// Checks a field with an exponent a cell.
fn check_extended(
    domain: &Domain,
    mantissas: &[f64],
    exponents: &[i32],
    strip: Range<usize>,
) -> Check {
    let (width, height) = (domain.width(), domain.height());
    let target = domain.index(domain.target());
    let mut found = Check::default();
    let mut tiles = Tiles::new(width);
    let (mut residuals, mut slopes) = (vec![0.0; width], vec![0.0; width]);
    for row in strip {
        residuals.fill(0.0);
        slopes.fill(0.0);
        for col in 0..width {
            let index = row * width + col;
            if mantissas[index] < 0.0 || index == target {
                continue;
            }
            let around = [
                (col > 0).then(|| index - 1),
                (col + 1 < width).then(|| index + 1),
                (row > 0).then(|| index - width),
                (row + 1 < height).then(|| index + width),
            ];
            let here = Scaled::new(mantissas[index], exponents[index]);
            let (mut best, mut sum) = (Scaled::ZERO, 0.0);
            for neighbour in around.into_iter().flatten() {
                let u = Scaled::new(mantissas[neighbour], exponents[neighbour]);
                sum += u.relative_to(here.exponent);
                best = if u > best { u } else { best };
            }
            if here.is_zero() {
                found.unreached += usize::from(!best.is_zero());
                continue;
            }
            let mean = sum / (4.0 * (1.0 + domain.screening_coefficient(index)));
            residuals[col] = (here.mantissa - mean) / here.mantissa;
            let u = |neighbour: Option<usize>| {
                let u =
                    neighbour.map_or(Scaled::ZERO, |it| Scaled::new(mantissas[it], exponents[it]));
                u.relative_to(here.exponent) / here.mantissa
            };
            let [west, east, north, south] = around.map(u);
            slopes[col] = 0.25 * ((east - west).powi(2) + (south - north).powi(2));
            found.worst_residual = found.worst_residual.max(residuals[col].abs());
            found.local_maxima += usize::from(best <= here);
            found.reachable += 1;
        }
        tiles.add_row(row, &residuals, &slopes);
    }
    found.worst_tile = tiles.finish();
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cancellation::Cancellation;
    use crate::cell::Cell;
    use crate::screening::Screening;
    use crate::solver::Solver;

    /// A hall of so many cells a side with a box in it.
    fn hall(side: usize) -> Domain {
        let mut blocked = vec![false; side * side];
        for row in side / 2..side / 2 + side / 8 {
            blocked[row * side + side / 2..][..side / 8].fill(true);
        }
        Domain::new(side, side, blocked, Cell::new(side / 6, side / 5)).unwrap()
    }

    #[test]
    fn a_field_solved_with_screening_does_not_pass_for_one_without_though_its_residuals_are_small()
    {
        for (side, k) in [(512, 1.9e-4_f64), (512, 2e-5), (128, 1.9e-4)] {
            let domain = hall(side);
            let screened = domain
                .clone()
                .with_screening(&Screening::cells(0.5 / k.sqrt()));
            let mut solver = Solver::default();
            let wrong = solver
                .solve(&screened.unwrap(), &Cancellation::new())
                .unwrap();
            let threads = NonZeroUsize::MIN;
            let found = check(&domain, wrong.store(), threads);
            assert!(
                found.worst_residual < RESIDUAL_LIMIT || k > 1.8e-4,
                "{found:?}"
            );
            assert!(found.worst_tile > TILE_LIMIT, "{found:?}");
            let right = solver.solve(&domain, &Cancellation::new()).unwrap();
            let found = check(&domain, right.store(), threads);
            assert!(found.worst_tile < TILE_LIMIT / 10.0, "{found:?}");
        }
    }
}
