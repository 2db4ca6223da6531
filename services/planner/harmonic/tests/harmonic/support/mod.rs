//! Generated maps of every kind, independent checks, and angles between fields.
#![allow(dead_code, unused_imports, reason = "tests and benchmark each use a part")]

use harmonic::{Cancellation, Cell, Change, Domain, Field, Screening, Solver};

mod angles;
mod maps;
mod random;
mod reference;

pub(crate) use angles::{Angles, CLEAR};
pub(crate) use maps::{Kind, Map};
pub(crate) use random::Random;
pub(crate) use reference::{angle, leads_to_target, worst_residual};

pub(crate) fn domain(width: usize, height: usize, blocked: Vec<bool>, target: Cell) -> Domain {
    Domain::new(width, height, blocked, target).expect("a valid map")
}

/// Returns the domain with a screening length in cells.
pub(crate) fn screened(domain: Domain, length: f64) -> Domain {
    domain.with_screening(&Screening::cells(length)).expect("a valid screening")
}

pub(crate) fn solve(domain: &Domain) -> Field {
    solve_with(&mut Solver::default(), domain)
}

pub(crate) fn solve_with(solver: &mut Solver, domain: &Domain) -> Field {
    solver.solve(domain, &Cancellation::new()).expect("the map has a field")
}

pub(crate) fn solve_near(solver: &mut Solver, domain: &Domain, before: &Field) -> Field {
    solver.solve_near(domain, before, &Cancellation::new()).expect("the map has a field")
}

/// Returns the changes that block the free cells of a rectangle, except the target.
pub(crate) fn block(
    domain: &Domain,
    (col, row): (usize, usize),
    (width, height): (usize, usize),
) -> Vec<Change> {
    (row..row + height)
        .flat_map(|row| (col..col + width).map(move |col| Cell::new(col, row)))
        .filter(|&cell| cell != domain.target() && !domain.is_blocked(cell))
        .map(|cell| Change { cell, blocked: true })
        .collect()
}

/// Returns the cells of a map, row by row.
pub(crate) fn cells(width: usize, height: usize) -> impl Iterator<Item = Cell> {
    (0..width * height).map(move |index| Cell::new(index % width, index / width))
}

/// Returns the indices of the west, east, north and south neighbours inside the map.
pub(crate) fn around(width: usize, height: usize, index: usize) -> [Option<usize>; 4] {
    let (col, row) = (index % width, index / width);
    [
        (col > 0).then(|| index - 1),
        (col + 1 < width).then(|| index + 1),
        (row > 0).then(|| index - width),
        (row + 1 < height).then(|| index + width),
    ]
}
