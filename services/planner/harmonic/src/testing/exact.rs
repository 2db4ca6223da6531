//! The field by elimination, and the angles between its directions and those of another field.

use std::num::NonZeroUsize;

use super::reference::angle;
use crate::cancellation::Cancellation;
use crate::cell::Cell;
use crate::domain::Domain;
use crate::error::SolveError;
use crate::field::Field;
use crate::method::Method;
use crate::multifrontal::{self, BreadthFirst, Budget, Tree, Workspace};
use crate::verification;

/// The field of `domain` by multifrontal factorisation: exact but for the rounding of `f64`, on maps of any shape.
///
/// # Errors
/// See [`Solver::solve`](crate::Solver::solve).
pub fn exact(domain: &Domain) -> Result<Field, SolveError> {
    let cancellation = Cancellation::new();
    let budget = Budget::of(domain, u64::MAX);
    let pass = BreadthFirst::from_target(domain, &budget, &cancellation)?;
    let tree = Tree::of(&pass, &budget, &cancellation)?;
    let mut workspace = Workspace::default();
    let mut store =
        multifrontal::solve(domain, (&pass, &tree), None, &budget, &mut workspace, &cancellation)?;
    multifrontal::relax(domain, &pass, &mut store);
    let check = verification::check(domain, &store, NonZeroUsize::MIN);
    Ok(Field::new(domain, store, &check, Method::Multifrontal))
}

/// Angles between the directions of two fields of one map, degrees, over the cells that can reach the target.
#[derive(Clone, Copy, Debug, Default)]
pub struct Angles {
    /// The median.
    pub p50: f64,
    /// The 99th percentile.
    pub p99: f64,
    /// The largest angle.
    pub max: f64,
    /// The largest angle away from saddle points: in cells where u changes by at least [`CLEAR`] of itself from one cell to the
    /// next.
    pub clear_max: f64,
}

/// The relative change of u to the next cell from which on a direction is clear. Nearer to a saddle point, a change of u by a
/// thousandth turns the direction by degrees in any solution.
const CLEAR: f64 = 2e-3;

impl Angles {
    /// The angles between `field` and `right`, of the cells for which `counted` holds.
    pub fn between(field: &Field, right: &Field, counted: impl Fn(Cell) -> bool) -> Self {
        let mut angles = Vec::new();
        let mut clear_max = 0.0_f64;
        for row in 0..right.height() {
            for col in 0..right.width() {
                let cell = Cell::new(col, row);
                let Some(wanted) = right.direction(cell).filter(|_| counted(cell)) else {
                    continue;
                };
                let off = field.direction(cell).map_or(180.0, |it| angle(it, wanted));
                if steepness(right, cell) >= CLEAR {
                    clear_max = clear_max.max(off);
                }
                angles.push(off);
            }
        }
        angles.sort_by(f64::total_cmp);
        let Some(&max) = angles.last() else {
            return Self::default();
        };
        let at = |share: f64| angles[((angles.len() - 1) as f64 * share) as usize];
        Self { p50: at(0.5), p99: at(0.99), max, clear_max }
    }
}

/// |grad u| / u at a cell.
fn steepness(field: &Field, cell: Cell) -> f64 {
    let own = field.u(cell);
    let u = |dc: i64, dr: i64| {
        let there = field.u_at(cell.col as i64 + dc, cell.row as i64 + dr);
        there.relative_to(own.exponent) / own.mantissa
    };
    (0.5 * (u(1, 0) - u(-1, 0))).hypot(0.5 * (u(0, 1) - u(0, -1)))
}
