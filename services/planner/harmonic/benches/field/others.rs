//! Dijkstra's algorithm over eight neighbours.

use harmonic::{Cell, Domain};

use crate::fastest;

pub(crate) fn dijkstra(domain: &Domain) -> f64 {
    const STRAIGHT: u32 = 1000;
    const DIAGONAL: u32 = 1414;
    let steps: [(isize, isize); 8] =
        [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1)];
    let start = (domain.target().col as u32, domain.target().row as u32);
    fastest(3, || {
        let distances = pathfinding::prelude::dijkstra_all(&start, |&(col, row)| {
            steps.into_iter().filter_map(move |(dx, dy)| {
                let cost = if dx * dy == 0 { STRAIGHT } else { DIAGONAL };
                let (c, r) = (
                    (col as usize).checked_add_signed(dx)?,
                    (row as usize).checked_add_signed(dy)?,
                );
                (!domain.is_blocked(Cell::new(c, r))).then_some(((c as u32, r as u32), cost))
            })
        });
        std::hint::black_box(distances.len());
    })
}
