//! Choice of the first method, by the shape of the free space.
//!
//! Where the mean width of the free space is large, multigrid is chosen at once. Otherwise a
//! breadth-first pass from the target gives the path lengths, hence the range of u, and the exact
//! cost of the factorisation.

use crate::{
    Domain, SolveError,
    multifrontal::{BreadthFirst, Job, Ordered, Tree},
    real::Real as _,
    store::Store,
};

/// Mean width of free space, in cells, from which multigrid is chosen at once.
const WIDE: f64 = 32.0;

/// Orders of magnitude of u between the largest and smallest normal `f32`, less a reserve.
const SINGLE_DECADES: f64 = 62.0;

/// Times in nanoseconds on one machine; only their ratios matter.
const SET_UP_PER_CELL: f64 = 3.0;
const SINGLE_CYCLE_PER_CELL: f64 = 1.1;
const MULTIFRONTAL_PER_CELL: f64 = 65.0;
const MULTIFRONTAL_PER_OPERATION: f64 = 0.15;

/// Costs of a further band: a set-up and cycles of its own, in nanoseconds per cell.
///
/// Its depth limits the cycles, because a cycle takes u some cells further where u falls steeply.
const BAND_PER_CELL: f64 = 15.0;
const BAND_CYCLE_PER_CELL: f64 = 2.2;
const BAND_CYCLES: f64 = 20.0;
const CELLS_PER_CYCLE: f64 = 6.0;

fn further_bands(bands: f64, decades_per_cell: f64) -> f64 {
    let depth = SINGLE_DECADES / decades_per_cell;
    let cycles = (depth / CELLS_PER_CYCLE).min(BAND_CYCLES);
    bands.max(0.0) * (BAND_PER_CELL + BAND_CYCLE_PER_CELL * cycles)
}

/// Returns the multigrid cycles for a range of u; in narrow passages, one covers three to four
/// orders of magnitude.
fn cycles(decades: f64) -> f64 {
    6.0 + decades / 3.5
}

/// Returns the order of a factorisation that costs less than multigrid.
pub(super) fn plan(job: Job<'_>) -> Result<Option<Ordered>, SolveError> {
    let domain = job.domain;
    let width = mean_width(domain);
    if width >= WIDE {
        return Ok(None);
    }
    let Some(pass) = unless_too_costly(BreadthFirst::from_target(job))? else {
        return Ok(None);
    };
    let cells = pass.len() as f64;
    // Runs along a passage also count; on mazes they make the mean width about 1.7 times too large.
    let passage = (width + 1.0) / 1.7 - 1.0;
    let per_cell = decades_per_cell(domain, passage);
    let decades = pass.levels.len() as f64 * per_cell;
    let first = SET_UP_PER_CELL + SINGLE_CYCLE_PER_CELL * cycles(decades.min(SINGLE_DECADES));
    let further = further_bands(decades / SINGLE_DECADES - 1.0, per_cell);
    let cost = domain.blocked().len() as f64 * (first + further);
    // The factorisation costs more than this on any map, so its tree is not built.
    if cost < 0.5 * MULTIFRONTAL_PER_CELL * cells {
        return Ok(None);
    }
    if_cheaper(pass, cost, job)
}

fn unless_too_costly<T>(found: Result<T, SolveError>) -> Result<Option<T>, SolveError> {
    match found {
        Err(SolveError::TooCostly { .. }) => Ok(None),
        found => found.map(Some),
    }
}

/// Returns the order for the unknown cells of `pass` if its factorisation takes at most
/// `nanoseconds`.
fn if_cheaper(
    pass: BreadthFirst,
    nanoseconds: f64,
    job: Job<'_>,
) -> Result<Option<Ordered>, SolveError> {
    let cells = pass.unknown().len() as f64;
    let operations = (nanoseconds - MULTIFRONTAL_PER_CELL * cells) / MULTIFRONTAL_PER_OPERATION;
    let tree = Tree::of(&pass, job.with_operations(operations));
    Ok(unless_too_costly(tree)?.map(|tree| (pass, tree)))
}

/// Covers the cells with u below the range of single precision. Returns `None` if multigrid in
/// bands costs less.
pub(super) fn beyond_single(job: Job<'_>, store: &Store) -> Result<Option<Ordered>, SolveError> {
    let is_known = |index: usize| store.raw(index).0 > f32::KNOWN;
    let pass = BreadthFirst::from_known(job, is_known);
    let Some(pass) = unless_too_costly(pass)?.filter(|pass| !pass.unknown().is_empty()) else {
        return Ok(None);
    };
    let per_cell = decades_per_cell(job.domain, pass.width());
    let bands = (pass.levels.len() as f64 * per_cell / SINGLE_DECADES).max(1.0);
    let bands = job.domain.blocked().len() as f64 * further_bands(bands, per_cell);
    if_cheaper(pass, bands, job)
}

/// Returns the orders of magnitude by which u falls per cell along a passage.
///
/// u falls like exp(-pi x / width), and by screening with cosh(1 / L) = 1 + 2 k.
fn decades_per_cell(domain: &Domain, width: f64) -> f64 {
    let confined = std::f64::consts::PI / (width + 1.0) / std::f64::consts::LN_10;
    let screened = (1.0 + 2.0 * domain.mean_screening()).acosh() / std::f64::consts::LN_10;
    confined.hypot(screened)
}

/// Returns the mean length of runs of free cells along rows or columns, whichever is shorter.
fn mean_width(domain: &Domain) -> f64 {
    let width = domain.width();
    let walls = vec![true; width];
    let mut above: &[bool] = &walls;
    let (mut free, mut along_rows, mut along_columns) = (0_usize, 0_usize, 0_usize);
    for row in domain.blocked().chunks_exact(width) {
        // Short sums fit in bytes, of which the compiler adds sixteen or more at a time.
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
