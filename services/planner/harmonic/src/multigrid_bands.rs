//! Multigrid for wide maps whose u spans more than an `f64` holds: a screening length far below the size of the map.
//!
//! u is solved band by band from the target outwards. The unknowns of a band are the cells not resolved before; u of the
//! resolved cells beside them is their inflow. Unknowns that come out well inside the range of `f64` are resolved, with the
//! exponent of the band; the others are unknowns of the next band. Cells farther out have no influence on resolved ones but
//! through cells of u some hundred orders of magnitude smaller.

use crate::cancellation::Cancellation;
use crate::cell::Cell;
use crate::domain::Domain;
use crate::error::SolveError;
use crate::multigrid::Multigrid;
use crate::real::Real;
use crate::scaled::{Scaled, pow2};
use crate::store::{BLOCKED, Store};

/// A cell whose direction a coarse correction turns by more than this, radians, has not settled. Stricter than for a solve that is
/// continued where it fails verification.
const TOLERANCE: f64 = 3e-4;

/// Cycles for one band: its range at 1.4 orders of magnitude a cycle, with a reserve.
const CYCLES: usize = 450;

/// Cells of u above this are resolved, the largest inflow of a band being 2^900.
const RESOLVED: f64 = 1e-200;

/// u of every cell of `domain` that a band resolves; 0 elsewhere.
pub(crate) fn solve(domain: &Domain, cancellation: &Cancellation) -> Result<Store, SolveError> {
    let (width, height) = (domain.width(), domain.height());
    let mut levels = Multigrid::<f64>::new(width, height);
    let mut u = vec![Scaled::ZERO; width * height];
    u[domain.index(domain.target())] = Scaled::ONE;
    let mut inverse = vec![0.0; width * height];
    let guess = vec![0.0; width];
    while let Some((top, inflow)) = inflow(domain, &u) {
        for (index, inverse) in inverse.iter_mut().enumerate() {
            let open = !domain.blocked()[index] && u[index].is_zero();
            *inverse = if open { 0.25 / (1.0 + domain.screening_coefficient(index)) } else { 0.0 };
        }
        levels.load(|row| (&inverse[row * width..(row + 1) * width], &guess), inflow.into_iter());
        levels.start_from_sources();
        for cycle in 0..CYCLES {
            cancellation.check()?;
            // The first cycles have not reached every cell yet, and what is zero does not change.
            if levels.cycle(Some(TOLERANCE)).unsettled == 0 && cycle >= 4 {
                break;
            }
        }
        // A further cycle computes the residuals.
        levels.cycle(None);
        levels.finish();
        let mut resolved = 0_usize;
        levels.unload(|row, values| {
            for (u, &value) in u[row * width..].iter_mut().zip(values) {
                if u.is_zero() && value > RESOLVED {
                    *u = Scaled::new(value, top - f64::TOP);
                    resolved += 1;
                }
            }
        });
        if resolved == 0 {
            break;
        }
    }
    let mantissas = u
        .iter()
        .zip(domain.blocked())
        .map(|(u, &blocked)| if blocked { BLOCKED } else { u.mantissa });
    Ok(Store::Extended {
        mantissas: mantissas.collect(),
        exponents: u.iter().map(|u| u.exponent).collect(),
    })
}

/// The inflow from resolved cells to their free neighbours that are not, scaled to at most 2^TOP, after the exponent it was
/// scaled by. `None` if every cell that can be reached is resolved.
fn inflow(domain: &Domain, u: &[Scaled]) -> Option<(i32, Vec<(Cell, f64)>)> {
    let width = domain.width();
    let mut edges: Vec<(usize, Scaled)> = Vec::new();
    for (index, &from) in u.iter().enumerate().filter(|(_, u)| !u.is_zero()) {
        let around = domain.neighbours(index).into_iter().flatten();
        let open = |to: &usize| u[*to].is_zero() && !domain.blocked()[*to];
        edges.extend(around.filter(open).map(|to| (to, from)));
    }
    let top = edges.iter().map(|(_, u)| u.exponent).max()?;
    let scale = pow2(f64::TOP);
    let inflow = edges
        .into_iter()
        .map(|(to, u)| (Cell::new(to % width, to / width), u.relative_to(top) * scale));
    Some((top, inflow.filter(|(_, value)| *value > 0.0).collect()))
}
