//! The check every field passes before it is handed out.
//!
//! Two promises, cell by cell: the equation holds relatively to u itself (a global norm says nothing of cells where u is
//! 1e-50), and some neighbour is strictly better, so that following the field from anywhere ends at the target.

use super::breadth::{ABSENT, Pass};
use crate::domain::Domain;
use crate::field::Store;
use crate::scaled::Scaled;

/// Largest componentwise relative residual of a published field.
pub(super) const RESIDUAL_LIMIT: f64 = 1e-4;

/// What a check found.
pub(super) struct Check {
    /// Largest relative residual; infinite if a reachable cell has u = 0.
    pub worst_residual: f64,
    /// Reachable cells but the target without a strictly better neighbour.
    pub stalled: usize,
}

impl Check {
    /// Whether the field may be handed out.
    pub(super) fn holds(&self, limit: f64) -> bool {
        self.stalled == 0 && self.worst_residual <= limit
    }
}

/// Checks every reachable cell of a field of any range.
pub(super) fn check(domain: &Domain, store: &Store, pass: &Pass) -> Check {
    let u = |index: u32| match store {
        Store::Single { values, exponent } => {
            Scaled::new(f64::from(values[index as usize]), *exponent)
        }
        Store::Extended {
            mantissas,
            exponents,
        } => Scaled::new(mantissas[index as usize], exponents[index as usize]),
    };
    let mut found = Check {
        worst_residual: 0.0,
        stalled: 0,
    };
    for &cell in pass.order.iter().skip(1) {
        let here = u(cell);
        let mut best = Scaled::ZERO;
        let mut sum = 0.0;
        for place in pass.neighbours(cell) {
            if place != ABSENT {
                let neighbour = u(pass.order[place as usize]);
                sum += neighbour.relative_to(here.exponent);
                if neighbour > best {
                    best = neighbour;
                }
            }
        }
        let mean = sum / (4.0 * (1.0 + domain.absorption_at(cell as usize)));
        let residual = (here.mantissa - mean).abs() / here.mantissa;
        // A zero u divides by zero: not a number, and then as bad as can be.
        found.worst_residual = found.worst_residual.max(if residual.is_nan() {
            f64::INFINITY
        } else {
            residual
        });
        if best <= here {
            found.stalled += 1;
        }
    }
    found
}
