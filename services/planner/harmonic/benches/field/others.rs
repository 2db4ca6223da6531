//! Dijkstra's algorithm over eight neighbours.

use harmonic::{Cell, Domain};

use crate::fastest;

pub(crate) fn dijkstra(domain: &Domain) -> f64 {
    const STRAIGHT: u32 = 1000;
    const DIAGONAL: u32 = 1414;
    let steps: [(isize, isize, u32); 8] = [
        (1, 0, STRAIGHT),
        (-1, 0, STRAIGHT),
        (0, 1, STRAIGHT),
        (0, -1, STRAIGHT),
        (1, 1, DIAGONAL),
        (-1, 1, DIAGONAL),
        (1, -1, DIAGONAL),
        (-1, -1, DIAGONAL),
    ];
    let start = (domain.target().col as u32, domain.target().row as u32);
    fastest(3, || {
        let distances = pathfinding::prelude::dijkstra_all(&start, |&(col, row)| {
            steps.into_iter().filter_map(move |(dx, dy, cost)| {
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
