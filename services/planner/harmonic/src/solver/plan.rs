//! The choice of the first method, by the shape of the free space.
//!
//! Multigrid costs some nanoseconds a cell for every few orders of magnitude that u spans; the multifrontal
//! factorisation costs the square of the passages' width a cell, whatever u spans. The mean width of the free space is
//! counted first. Where it is large, multigrid is chosen at once; elsewhere one breadth-first pass from the target gives
//! the length of the ways, with that the range of u, and the exact cost of the factorisation.

use crate::cancellation::Cancellation;
use crate::domain::Domain;
use crate::error::SolveError;
use crate::method::Method;
use crate::multifrontal::{BreadthFirst, Budget, Tree};
use crate::real::Real as _;
use crate::store::Store;

/// Free space of this mean width, cells, is left to multigrid without a further look.
const WIDE: f64 = 32.0;

/// Orders of magnitude of u that fit single precision between the largest and the smallest normal number, less some.
const SINGLE_DECADES: f64 = 62.0;

/// Measured on one machine; only their ratios matter. Nanoseconds.
const SET_UP_PER_CELL: f64 = 3.0;
const SINGLE_CYCLE_PER_CELL: f64 = 1.1;
const MULTIFRONTAL_PER_CELL: f64 = 65.0;
const MULTIFRONTAL_PER_OPERATION: f64 = 0.15;

/// Nanoseconds a cell of the map that multigrid in single precision takes for a range of u, in as many bands as that needs.
fn multigrid_per_cell(decades: f64) -> f64 {
    let bands = (decades / SINGLE_DECADES).max(1.0);
    bands * (SET_UP_PER_CELL + SINGLE_CYCLE_PER_CELL * cycles(decades / bands))
}

/// Cycles multigrid takes for a range of u: in narrow passages one converges three to four orders of magnitude.
fn cycles(decades: f64) -> f64 {
    6.0 + decades / 3.5
}

/// The methods to try, and the results that the choice needed.
pub(super) struct Plan {
    /// Methods in the order in which to try them; the multifrontal factorisation is the last resort in any case.
    pub methods: Vec<Method>,
    /// The breadth-first pass and the tree of fronts, if they were needed.
    pub multifrontal: Option<(BreadthFirst, Tree)>,
}

impl Plan {
    /// Multigrid in single precision and beyond its range, then in double precision.
    fn multigrid() -> Self {
        use Method::{Multifrontal, MultigridDouble, MultigridSingle};
        Self { methods: vec![MultigridSingle, MultigridDouble, Multifrontal], multifrontal: None }
    }
}

/// The plan for `domain`; the multifrontal factorisation is in it only as the last resort where `budget` refuses it.
///
/// # Errors
/// [`SolveError::Cancelled`].
pub(super) fn plan(
    domain: &Domain,
    budget: &Budget,
    cancellation: &Cancellation,
) -> Result<Plan, SolveError> {
    let width = mean_width(domain);
    if width >= WIDE {
        return Ok(Plan::multigrid());
    }
    let pass = match BreadthFirst::from_target(domain, budget, cancellation) {
        Err(SolveError::TooCostly { .. }) => return Ok(Plan::multigrid()),
        pass => pass?,
    };
    let cells = pass.len() as f64;
    // The runs along a passage count into the mean width too; on mazes that makes it about 1.7 times too large.
    let passage = (width + 1.0) / 1.7 - 1.0;
    let decades = pass.levels.len() as f64 * decades_per_cell(domain, passage);
    let multigrid = Plan::multigrid();
    let cost = domain.blocked().len() as f64 * multigrid_per_cell(decades);
    // The factorisation costs more than this on any map: no need to build its tree.
    if cost < 0.5 * MULTIFRONTAL_PER_CELL * cells {
        return Ok(multigrid);
    }
    let tree = match Tree::of(&pass, budget, cancellation) {
        Err(SolveError::TooCostly { .. }) => return Ok(multigrid),
        tree => tree?,
    };
    let exact = MULTIFRONTAL_PER_CELL * cells + MULTIFRONTAL_PER_OPERATION * tree.cost.operations;
    let methods = if exact <= cost { vec![Method::Multifrontal] } else { multigrid.methods };
    Ok(Plan { methods, multifrontal: Some((pass, tree)) })
}

/// The cells in which u is smaller than `store` says, which has what single precision can hold, and the tree of their fronts; none if
/// multigrid in bands costs less.
///
/// # Errors
/// [`SolveError::Cancelled`].
pub(super) fn beyond_single(
    domain: &Domain,
    store: &Store,
    budget: &Budget,
    cancellation: &Cancellation,
) -> Result<Option<(BreadthFirst, Tree)>, SolveError> {
    let is_known = |index: usize| store.raw(index).0 > f32::KNOWN;
    let pass = match BreadthFirst::from_known(domain, is_known, budget, cancellation) {
        Err(SolveError::TooCostly { .. }) => return Ok(None),
        pass => pass?,
    };
    let cells = pass.unknown().len() as f64;
    let decades = pass.levels.len() as f64 * decades_per_cell(domain, pass.width());
    let bands = domain.blocked().len() as f64 * multigrid_per_cell(decades);
    if cells == 0.0 || MULTIFRONTAL_PER_CELL * cells > bands {
        return Ok(None);
    }
    let tree = match Tree::of(&pass, budget, cancellation) {
        Err(SolveError::TooCostly { .. }) => return Ok(None),
        tree => tree?,
    };
    let exact = MULTIFRONTAL_PER_CELL * cells + MULTIFRONTAL_PER_OPERATION * tree.cost.operations;
    Ok((exact <= bands).then_some((pass, tree)))
}

/// The orders of magnitude by which u falls a cell along a passage of this width: like exp(-pi x / width), and by screening.
fn decades_per_cell(domain: &Domain, width: f64) -> f64 {
    let confined = std::f64::consts::PI / (width + 1.0) / std::f64::consts::LN_10;
    confined.hypot(screened(domain))
}

/// The orders of magnitude by which screening makes u fall a cell on its own: cosh(1 / L) = 1 + 2 k.
fn screened(domain: &Domain) -> f64 {
    (1.0 + 2.0 * domain.screening().least()).acosh() / std::f64::consts::LN_10
}

/// The mean length of the runs of free cells along rows or along columns, whichever is the shorter.
fn mean_width(domain: &Domain) -> f64 {
    let width = domain.width();
    let walls = vec![true; width];
    let mut above: &[bool] = &walls;
    let (mut free, mut along_rows, mut along_columns) = (0_usize, 0_usize, 0_usize);
    for row in domain.blocked().chunks_exact(width) {
        // Short sums in bytes, which the compiler adds up sixteen or more at a time.
        for (row, above) in row.chunks(128).zip(above.chunks(128)) {
            let (mut open, mut starts) = (0_u8, 0_u8);
            for (&here, &above) in row.iter().zip(above) {
                open += u8::from(!here);
                starts += u8::from(!here & above);
            }
            free += usize::from(open);
            along_columns += usize::from(starts);
        }
        along_rows += usize::from(!row[0]);
        for (before, here) in row[..width - 1].chunks(128).zip(row[1..].chunks(128)) {
            let mut starts = 0_u8;
            for (&before, &here) in before.iter().zip(here) {
                starts += u8::from(before & !here);
            }
            along_rows += usize::from(starts);
        }
        above = row;
    }
    free as f64 / along_rows.max(along_columns).max(1) as f64
}
