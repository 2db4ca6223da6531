//! The inflow at single cells, restricted to the coarse levels: interpolation transposed, for a handful of cells a level.

use super::coarse::Coarse;
use super::finest::Finest;
use super::grid::{EE, EO, Grid, MARGIN, OE};
use crate::real::Real;

/// Inflow at a cell, by column and row.
type Flow<R> = ((usize, usize), R);

/// Makes the inflow of the finest level the right-hand side of every coarse one.
pub(super) fn restrict<R: Real>(finest: &Finest<R>, coarse: &mut [Coarse<R>]) {
    let mut flows = Vec::new();
    for source in &finest.sources {
        let at = source.at;
        let line = finest.weights.each_ref().map(|row| row[at]);
        let corner = || finest.corner_weights(at);
        spread(&finest.grid, source.plane, at, source.value, line, corner, &mut flows);
    }
    for level in coarse {
        for plane in &mut level.f {
            plane.fill(R::default());
        }
        let mut next = Vec::new();
        for &((col, row), value) in &flows {
            if col >= level.grid.width || row >= level.grid.height {
                continue;
            }
            let (plane, at) = level.grid.locate(col, row);
            level.f[plane][at] += value;
            let line = level.weights.each_ref().map(|row| row[at]);
            let corner = || level.corner_weights(at);
            spread(&level.grid, plane, at, value, line, corner, &mut next);
        }
        next.sort_unstable_by_key(|flow| flow.0);
        next.dedup_by(|b, a| {
            let same = a.0 == b.0;
            if same {
                a.1 += b.1;
            }
            same
        });
        flows = next;
    }
}

/// Adds `value` of the cell at `at` of a plane to the coarse cells it is interpolated from: with the weights `line` (west,
/// east, north, south), or those of `corner` for an odd-odd cell.
fn spread<R: Real>(
    grid: &Grid,
    plane: usize,
    at: usize,
    value: R,
    [west, east, north, south]: [R; 4],
    corner: impl Fn() -> [R; 4],
    flows: &mut Vec<Flow<R>>,
) {
    let row = (at - MARGIN) / grid.stride - 1;
    let col = (at - MARGIN) % grid.stride;
    let mut add = |col: usize, row: usize, weight: R| {
        if weight > R::default() {
            flows.push(((col, row), value * weight));
        }
    };
    match plane {
        EE => add(col, row, R::ONE),
        OE => {
            add(col, row, west);
            add(col + 1, row, east);
        }
        EO => {
            add(col, row, north);
            add(col, row + 1, south);
        }
        _ => {
            let [north_west, north_east, south_west, south_east] = corner();
            add(col, row, north_west);
            add(col + 1, row, north_east);
            add(col, row + 1, south_west);
            add(col + 1, row + 1, south_east);
        }
    }
}
