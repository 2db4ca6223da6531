//! Solves that start from the previous field, after a few cells changed.

use std::time::Instant;

use crate::support::{Kind, Map, Random, block, solve_near, solve_with};
use harmonic::{Cell, Solver};

/// Timed solves per map.
const UPDATES: usize = 100;

pub(crate) fn table() {
    println!("\nUpdates: 3 x 3 blocks that appear and vanish at random, us");
    println!("map            N  length      p50      p90      p99");
    for kind in [Kind::Empty, Kind::Drums, Kind::Office] {
        for n in [50, 120, 280, 512] {
            for length in [f64::INFINITY, 7.0] {
                row(kind, n, length);
            }
        }
    }
}

fn row(kind: Kind, n: usize, length: f64) {
    let mut domain = Map::generate(kind, n, n, 1).screened(length);
    let mut solver = Solver::default();
    let mut field = solve_with(&mut solver, &domain);
    let mut random = Random::new(9);
    let mut times = Vec::new();
    while times.len() < UPDATES {
        let (col, row) = (random.below(n - 8) + 2, random.below(n - 8) + 2);
        let mut changes = block(&domain, (col, row), (3, 3));
        if changes.is_empty() || !field.is_reachable(Cell::new(col, row)) {
            continue;
        }
        for blocked in [true, false] {
            changes.iter_mut().for_each(|change| change.blocked = blocked);
            let start = Instant::now();
            domain.apply(&changes).expect("valid changes");
            field = solve_near(&mut solver, &domain, &field);
            times.push(start.elapsed().as_secs_f64() * 1e6);
        }
    }
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
    println!(
        "{:<10} {n:>5} {length:>7} {:>8.0} {:>8.0} {:>8.0}",
        format!("{kind:?}"),
        at(0.5),
        at(0.9),
        at(0.99),
    );
}
