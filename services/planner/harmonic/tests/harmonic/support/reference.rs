//! Slow solver that shares nothing with the fast ones.
//!
//! Banded elimination in row order carries the right-hand side in extended range. The result is
//! polished and its residual measured.

use harmonic::{Cell, Domain, Field, Scaled};

use super::around;

/// u of every cell to a relative error of about 1e-12.
pub(crate) struct Reference {
    domain: Domain,
    u: Vec<Scaled>,
    /// Largest relative residual of the cells with u > 0.
    pub worst_residual: f64,
}

impl Reference {
    /// Solves `domain` in width^3 * height operations and width^2 * height numbers, for small or
    /// narrow maps.
    pub(crate) fn solve(domain: &Domain) -> Self {
        let width = domain.width();
        let cells = domain.blocked().len();
        let target = domain.target().row * width + domain.target().col;
        let free = |i: usize| !domain.blocked()[i];
        // Row i holds its positive couplings (minus the entries) to i + 1 ..= i + width, and its
        // diagonal.
        let mut coupling = vec![0.0; cells * width];
        let mut diagonal = vec![1.0; cells];
        let mut right = vec![Scaled::ZERO; cells];
        for i in (0..cells).filter(|&i| free(i) && i != target) {
            diagonal[i] = 4.0 * (1.0 + domain.screening_of(i));
            let [_, east, _, south] = around(domain.width(), domain.height(), i);
            for next in [east, south].into_iter().flatten().filter(|&n| free(n) && n != target) {
                coupling[i * width + (next - i - 1)] += 1.0;
            }
            if around(domain.width(), domain.height(), i).contains(&Some(target)) {
                right[i] = Scaled::ONE;
            }
        }
        for i in (0..cells).filter(|&i| free(i) && i != target) {
            let row = coupling[i * width..(i + 1) * width].to_vec();
            for (a, &weight) in row.iter().enumerate().filter(|(_, w)| **w > 0.0) {
                let j = i + 1 + a;
                let share = weight / diagonal[i];
                right[j] = sum(&[right[j], scale(right[i], share)]);
                diagonal[j] -= share * weight;
                for (b, &other) in row.iter().enumerate().skip(a + 1).filter(|(_, w)| **w > 0.0) {
                    coupling[j * width + (b - a - 1)] += share * other;
                }
            }
        }
        let mut u = vec![Scaled::ZERO; cells];
        for i in (0..cells).rev().filter(|&i| free(i)) {
            let row = coupling[i * width..(i + 1) * width].iter().enumerate();
            let total = row
                .filter(|(_, w)| **w > 0.0)
                .fold(right[i], |total, (a, &w)| sum(&[total, scale(u[i + 1 + a], w)]));
            u[i] = if i == target { Scaled::ONE } else { scale(total, 1.0 / diagonal[i]) };
        }
        let mut reference = Self { domain: domain.clone(), u, worst_residual: f64::INFINITY };
        for _ in 0..4 {
            reference.worst_residual = reference.polish();
        }
        reference
    }

    /// Returns the central difference of u in units of the largest u around, and that u; `None`
    /// where u is zero.
    fn gradient(&self, cell: Cell) -> Option<[f64; 2]> {
        let i = cell.row * self.domain.width() + cell.col;
        let [west, east, north, south] = self.around(i);
        if self.u[i].is_zero() {
            return None;
        }
        let larger = |a, b| if b > a { b } else { a };
        let largest = [west, east, north, south].into_iter().fold(self.u[i], larger);
        let relative = |u: Scaled| u.relative_to(largest.exponent) / largest.mantissa;
        Some([relative(east) - relative(west), relative(south) - relative(north)])
    }

    /// Returns the share of directions of `field` more than one degree off, and the worst clear
    /// angle in degrees.
    ///
    /// Clear cells have a gradient above 1e-4 of the largest u around.
    pub(crate) fn compare(&self, field: &Field) -> (f64, f64) {
        let (mut off, mut seen, mut worst) = (0, 0, 0.0_f64);
        for index in 0..self.u.len() {
            let width = self.domain.width();
            let cell = Cell::new(index % width, index / width);
            let gradient = self.gradient(cell);
            let Some(gradient) = gradient.filter(|_| cell != self.domain.target()) else {
                continue;
            };
            let error = field.direction(cell).map_or(180.0, |it| angle(gradient, it));
            seen += 1;
            off += usize::from(error > 1.0);
            if gradient[0].hypot(gradient[1]) > 1e-4 {
                worst = worst.max(error);
            }
        }
        (off as f64 / f64::from(seen.max(1)), worst)
    }

    /// Returns u of the west, east, north and south neighbours.
    fn around(&self, index: usize) -> [Scaled; 4] {
        let around = around(self.domain.width(), self.domain.height(), index);
        around.map(|there| there.map_or(Scaled::ZERO, |there| self.u[there]))
    }

    /// Runs two Gauss-Seidel passes and returns the largest relative change of the second.
    fn polish(&mut self) -> f64 {
        let target = self.domain.target().row * self.domain.width() + self.domain.target().col;
        let cells: Vec<usize> =
            (0..self.u.len()).filter(|&i| !self.u[i].is_zero() && i != target).collect();
        let mut polish = |i: usize| {
            let weight = 0.25 / (1.0 + self.domain.screening_of(i));
            let mean = scale(sum(&self.around(i)), weight);
            let ratio = mean.relative_to(self.u[i].exponent) / self.u[i].mantissa;
            self.u[i] = mean;
            (ratio - 1.0).abs()
        };
        cells.iter().for_each(|&i| _ = polish(i));
        cells.into_iter().rev().map(polish).fold(0.0, f64::max)
    }
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

fn scale(a: Scaled, factor: f64) -> Scaled {
    Scaled::new(a.mantissa * factor, a.exponent)
}

fn sum(terms: &[Scaled]) -> Scaled {
    let nonzero = terms.iter().filter(|term| !term.is_zero());
    let largest = nonzero.map(|term| term.exponent).max().unwrap_or_default();
    Scaled::new(terms.iter().map(|term| term.relative_to(largest)).sum(), largest)
}
