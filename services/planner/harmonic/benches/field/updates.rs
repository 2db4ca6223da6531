//! Updates after a few cells changed: whole solves that start from the field before, and updates in windows.

use std::time::Instant;

use harmonic::testing::{Kind, Map, Random};
use harmonic::{Cancellation, Cell, Screening, Settings, Solver, Verdict};

use crate::block;

/// Updates timed for a row.
const UPDATES: usize = 100;

/// 3 x 3 blocks that appear one by one and vanish again.
pub(crate) fn table(quick: bool) {
    println!("\nUpdates: 3 x 3 blocks that appear and vanish at random, us");
    println!(
        "{:<10} {:>5} {:>7} {:<8} {:>8} {:>8} {:>8}  verdicts",
        "map", "N", "length", "", "p50", "p90", "p99"
    );
    let sides: &[usize] = if quick {
        &[50, 120, 280, 512]
    } else {
        &[50, 120, 280, 512, 1024, 2048, 4096]
    };
    for kind in [Kind::Empty, Kind::Drums, Kind::Office] {
        for &n in sides {
            for length in [f64::INFINITY, 7.0] {
                // Whole updates of the largest maps take what their full solves take.
                if n <= 1024 {
                    row(kind, n, length, true);
                }
                row(kind, n, length, false);
            }
        }
    }
}

fn row(kind: Kind, n: usize, length: f64, whole: bool) {
    let base = Map::generate(kind, n, n, 1)
        .domain()
        .and_then(|it| it.with_screening(&Screening::cells(length)))
        .expect("a valid map");
    let mut solver = Solver::new(Settings {
        whole_up_to: if whole { usize::MAX } else { 0 },
        ..Settings::default()
    });
    let solved = solver.solve(&base, &Cancellation::new()).expect("a field");
    let mut random = Random::new(9);
    let (mut domain, mut field) = (base.clone(), solved.clone());
    let mut times = Vec::new();
    let mut verdicts = [0; 3];
    while times.len() < UPDATES {
        let (col, row) = (random.below(n - 8) + 2, random.below(n - 8) + 2);
        let mut changes = block(&domain, col, row);
        if changes.is_empty() || !field.is_reachable(Cell::new(col, row)) {
            continue;
        }
        for blocked in [true, false] {
            changes
                .iter_mut()
                .for_each(|change| change.blocked = blocked);
            let start = Instant::now();
            let verdict = solver
                .update(&mut domain, &mut field, &changes, &Cancellation::new())
                .expect("an update");
            times.push(start.elapsed().as_secs_f64() * 1e6);
            verdicts[match verdict {
                Verdict::Solved => 0,
                Verdict::Provisional => 1,
                Verdict::PassageClosed => 2,
            }] += 1;
        }
        if !whole {
            // As the full solve behind it would.
            (domain, field) = (base.clone(), solved.clone());
        }
    }
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
    println!(
        "{:<10} {n:>5} {length:>7} {:<8} {:>8.0} {:>8.0} {:>8.0}  {} solved, {} provisional, {} passage closed",
        format!("{kind:?}"),
        if whole { "whole" } else { "window" },
        at(0.5),
        at(0.9),
        at(0.99),
        verdicts[0],
        verdicts[1],
        verdicts[2],
    );
}
