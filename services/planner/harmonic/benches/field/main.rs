//! `cargo bench -p harmonic --features bench`: times of the solver, beside those of plain passes over the grid and of other algorithms.
//!
//! Not criterion: what is asked for are ratios, and ratios hold only between times taken in one run, in turn. Every time
//! is the least of several runs. `cargo bench -p harmonic --features bench -- quick` leaves out the large maps, `-- updates` all but the
//! local updates.
//! `-- --maps DIR` adds the PGM maps of a directory.
#![allow(
    clippy::expect_used,
    clippy::print_stdout,
    missing_docs,
    reason = "a program for the developer's terminal"
)]

mod machine;
mod others;
mod real;
mod wavefront;

use std::{path::Path, time::Instant};

use harmonic::testing::{Kind, Map, Random};
use harmonic::{Cancellation, Cell, Change, Domain, Phase, Screening, Solver, Verdict};

/// Milliseconds of the fastest of `runs` calls.
fn fastest(runs: usize, mut call: impl FnMut()) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..runs {
        let start = Instant::now();
        call();
        best = best.min(start.elapsed().as_secs_f64() * 1e3);
    }
    best
}

/// More runs of what is short.
fn runs(cells: usize) -> usize {
    (4_000_000 / cells).clamp(3, 50)
}

fn main() {
    let asked = |word: &str| std::env::args().any(|argument| argument == word);
    let quick = asked("quick");
    if asked("updates") {
        return update_table(quick);
    }
    if asked("accuracy") {
        return accuracy_table();
    }
    if asked("warm") {
        return warm_table();
    }
    machine_table(quick);
    full_table(quick);
    if let Some(directory) = std::env::args().skip_while(|it| it != "--maps").nth(1) {
        real_table(Path::new(&directory));
    }
    screening_table();
    update_table(quick);
}

fn machine_table(quick: bool) {
    println!("\nThe machine: one pass over the grid, ms");
    println!(
        "{:>6} {:>14} {:>24}",
        "N", "stream f32", "red-black sweep f32"
    );
    for n in if quick {
        vec![50, 256, 512]
    } else {
        vec![50, 256, 512, 1024, 2048, 4096]
    } {
        println!(
            "{n:>6} {:>14.4} {:>24.4}",
            machine::stream(n),
            machine::sweep(n)
        );
    }
}

fn full_table(quick: bool) {
    println!(
        "\nFull solves without screening: set-up + solve + verification, ms, and as sweeps of the same grid"
    );
    println!(
        "{:<24} {:>9} {:<14} {:>9} {:>7} {:>9} {:>7} {:>9} {:>9} {:>8} {:>9}",
        "map",
        "cells",
        "method",
        "scratch",
        "sweeps",
        "target",
        "sweeps",
        "dijkstra",
        "x",
        "faer",
        "log10 u"
    );
    let kinds = [
        Kind::Empty,
        Kind::Drums,
        Kind::Office,
        Kind::Trap,
        Kind::Maze { corridor: 1 },
        Kind::Maze { corridor: 4 },
        Kind::Maze { corridor: 8 },
        Kind::Maze { corridor: 16 },
        Kind::Maze { corridor: 32 },
        Kind::Serpentine { corridor: 1 },
        Kind::Serpentine { corridor: 8 },
        Kind::Serpentine { corridor: 24 },
    ];
    for n in if quick {
        vec![50, 512]
    } else {
        vec![50, 256, 512, 1024, 2048, 4096]
    } {
        for kind in kinds {
            let narrow = matches!(kind, Kind::Maze { .. } | Kind::Serpentine { .. });
            // Seconds and gigabytes each, for nothing new.
            if n > 512 && narrow {
                continue;
            }
            let domain = Map::generate(kind, n, n, 1).domain().expect("a valid map");
            full_row(&format!("{kind:?}"), &domain, n <= 1024, n <= 512);
        }
    }
}

/// Public maps, where a directory of them is given: every PGM in it.
fn real_table(directory: &Path) {
    let entries = std::fs::read_dir(directory).expect("a directory of maps");
    let mut files: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "pgm"));
    files.sort();
    for file in files {
        let name = file.file_stem().unwrap_or_default().to_string_lossy();
        full_row(&name, &real::load(&file), true, false);
    }
}

/// One map: times from scratch and with the set-up kept, beside those of other algorithms.
fn full_row(name: &str, domain: &Domain, with_dijkstra: bool, with_faer: bool) {
    let cells = domain.blocked().len();
    let sweep = machine::sweep(cells.isqrt());
    let cancellation = Cancellation::new();
    // Memory is kept, the set-up is not: the map before was another.
    let (width, height) = (domain.width(), domain.height());
    let other = Map::generate(Kind::Drums, width, height, 2)
        .domain()
        .expect("a valid map");
    let mut solver = Solver::default();
    let mut scratch = f64::INFINITY;
    for _ in 0..runs(cells).min(12) {
        solver.solve(&other, &cancellation).expect("a field");
        scratch = scratch.min(fastest(1, || {
            solver.solve(domain, &cancellation).expect("a field");
        }));
    }
    let target = fastest(runs(cells), || {
        solver.solve(domain, &cancellation).expect("a field");
    });
    let field = solver.solve(domain, &cancellation).expect("a field");
    let dijkstra = with_dijkstra.then(|| others::dijkstra(domain));
    let faer = with_faer.then(|| others::sparse_cholesky(domain));
    let show = |time: Option<f64>| time.map_or("-".to_owned(), |time| format!("{time:.2}"));
    println!(
        "{name:<24} {:>9} {:<14} {scratch:>9.3} {:>7.0} {target:>9.3} {:>7.0} {:>9} {:>9} {:>8} {:>9.1}",
        format!("{width}x{height}"),
        field.verification().method.name(),
        scratch / sweep,
        target / sweep,
        show(dijkstra),
        show(dijkstra.map(|time| scratch / time)),
        show(faer),
        field.log10_u_min(),
    );
}

fn screening_table() {
    println!("\nFull solves by screening length in cells, N = 512: ms by phase");
    println!(
        "{:<24} {:>6} {:<14} {:>9} {:>9} {:>9} {:>9}",
        "map", "length", "method", "set-up", "solve", "verify", "log10 u"
    );
    for length in [f64::INFINITY, 11.18, 3.54] {
        for kind in [Kind::Empty, Kind::Drums, Kind::Office] {
            let domain = Map::generate(kind, 512, 512, 1)
                .domain()
                .expect("a valid map");
            let domain = domain
                .with_screening(&Screening::cells(length))
                .expect("a valid screening");
            let mut phases = [f64::INFINITY; 3];
            let mut method = "";
            let mut least = 0.0;
            for _ in 0..5 {
                let mut times = [0.0; 3];
                let mut start = Instant::now();
                let field = Solver::default()
                    .solve_observed(&domain, &Cancellation::new(), &mut |phase| {
                        let slot = match phase {
                            Phase::SetUp => 0,
                            Phase::Solved => 1,
                            _ => 2,
                        };
                        times[slot] += start.elapsed().as_secs_f64() * 1e3;
                        start = Instant::now();
                    })
                    .expect("a field");
                for (best, time) in phases.iter_mut().zip(times) {
                    *best = best.min(time);
                }
                method = field.verification().method.name();
                least = field.log10_u_min();
            }
            println!(
                "{:<24} {length:>6} {method:<14} {:>9.3} {:>9.3} {:>9.3} {least:>9.1}",
                format!("{kind:?}"),
                phases[0],
                phases[1],
                phases[2]
            );
        }
    }
}

fn update_table(quick: bool) {
    println!("\nLocal updates: 3 x 3 blocks placed at random, up to three between full solves, us");
    println!(
        "{:<28} {:>5} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7}  verdicts",
        "map", "N", "least", "p50", "p90", "p99", "x least", "x p50", "radius"
    );
    let sides: &[usize] = if quick {
        &[256, 512]
    } else {
        &[256, 512, 1024, 2048, 4096]
    };
    for kind in [Kind::Empty, Kind::Drums, Kind::Office] {
        let mut first = None;
        for &n in sides {
            let updates = random_updates(kind, n, 200);
            let mut times: Vec<f64> = updates.iter().map(|update| update.time).collect();
            times.sort_by(f64::total_cmp);
            let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
            let (least, middle) = *first.get_or_insert((at(0.0), at(0.5)));
            let mut radii: Vec<usize> = updates.iter().map(|update| update.radius).collect();
            radii.sort_unstable();
            let count = |verdict| updates.iter().filter(|u| u.verdict == verdict).count();
            println!(
                "{:<28} {n:>5} {:>7.0} {:>7.0} {:>7.0} {:>7.0} {:>7.2} {:>7.2} {:>7}  {} accurate, {} full solve advised, {} passage closed",
                format!("{kind:?}"),
                at(0.0),
                at(0.5),
                at(0.9),
                at(0.99),
                at(0.0) / least,
                at(0.5) / middle,
                radii[radii.len() / 2],
                count(Verdict::Accurate),
                count(Verdict::FullSolveAdvised),
                count(Verdict::PassageClosed),
            );
        }
    }
}

/// One timed update.
struct Update {
    /// Microseconds.
    time: f64,
    /// Cells from the block to the farthest one beside it whose u changed, at most [`FARTHEST`].
    radius: usize,
    verdict: Verdict,
}

/// Where the search for changed cells ends.
const FARTHEST: usize = 128;

fn random_updates(kind: Kind, n: usize, count: usize) -> Vec<Update> {
    let base = Map::generate(kind, n, n, 1).domain().expect("a valid map");
    let mut solver = Solver::default();
    let field = solver.solve(&base, &Cancellation::new()).expect("a field");
    let mut random = Random::new(9);
    let mut updates = Vec::new();
    let (mut domain, mut live) = (base.clone(), field.clone());
    while updates.len() < count {
        let (col, row) = (random.below(n - 8) + 2, random.below(n - 8) + 2);
        let changes = block(&domain, col, row);
        if changes.is_empty() || !live.is_reachable(Cell::new(col, row)) {
            continue;
        }
        let start = Instant::now();
        let verdict = solver
            .update(&mut domain, &mut live, &changes, &Cancellation::new())
            .expect("an update");
        let time = start.elapsed().as_secs_f64() * 1e6;
        let changed = |distance: &usize| {
            // Beyond the map u is zero, before and after.
            [
                Cell::new(col.wrapping_sub(*distance), row),
                Cell::new(col + distance, row),
                Cell::new(col, row.wrapping_sub(*distance)),
                Cell::new(col, row + distance),
            ]
            .into_iter()
            .any(|cell| live.u(cell) != field.u(cell))
        };
        let radius = (0..FARTHEST).rev().find(changed).unwrap_or(0);
        updates.push(Update {
            time,
            radius,
            verdict,
        });
        // As the full solve behind it would.
        if updates.len() % 3 == 0 {
            (domain, live) = (base.clone(), field.clone());
        }
    }
    updates
}

fn block(domain: &Domain, col: usize, row: usize) -> Vec<Change> {
    (row..row + 3)
        .flat_map(|row| (col..col + 3).map(move |col| Cell::new(col, row)))
        .filter(|&cell| cell != domain.target() && !domain.is_blocked(cell))
        .map(|cell| Change {
            cell,
            blocked: true,
        })
        .collect()
}

fn warm_table() {
    println!("{:<10} {:>5} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}", "map","N","k","scratch","near p50","near p99","wave","update p50");
    for kind in [Kind::Empty, Kind::Drums, Kind::Office] {
        for n in [120, 280, 512, 1024] {
            for length in [f64::INFINITY, 7.0] {
            let base = Map::generate(kind, n, n, 1).domain().expect("a valid map").with_screening(&Screening::cells(length)).expect("a screening");
            let mut solver = Solver::default();
            let scratch = fastest(8, || { solver.solve(&base, &Cancellation::new()).expect("a field"); });
            let mut random = Random::new(9);
            let mut field = solver.solve(&base, &Cancellation::new()).expect("a field");
            let mut other = (base.clone(), field.clone());
            let mut domain = base.clone();
            let (mut times, mut local) = (Vec::new(), Vec::new());
            let mut last: Vec<Change> = Vec::new();
            while times.len() < 60 {
                let (col, row) = (random.below(n - 8) + 2, random.below(n - 8) + 2);
                let changes = if times.len() % 2 == 1 { last.iter().map(|c| Change { blocked: false, ..*c }).collect() } else { block(&domain, col, row) };
                if changes.is_empty() { continue; }
                let start = Instant::now();
                domain.apply(&changes).expect("ok");
                field = solver.solve_near(&domain, &field, &Cancellation::new()).expect("a field");
                times.push(start.elapsed().as_secs_f64() * 1e3);
                let start = Instant::now();
                let _ = solver.update(&mut other.0, &mut other.1, &changes, &Cancellation::new()).expect("a field");
                local.push(start.elapsed().as_secs_f64() * 1e3);
                last = changes;
            }
            times.sort_by(f64::total_cmp); local.sort_by(f64::total_cmp);
            let (wave, _) = wavefront::time(&base, 10);
            println!("{:<10} {n:>5} {length:>9} {scratch:>9.3} {:>9.3} {:>9.3} {wave:>9.3} {:>9.3}", format!("{kind:?}"), times[30], times[58], local[30]);
        }}
    }
}

fn accuracy_table() {
    let kinds = [
        Kind::Empty,
        Kind::Drums,
        Kind::Office,
        Kind::Trap,
        Kind::Maze { corridor: 8 },
        Kind::Maze { corridor: 32 },
        Kind::Maze { corridor: 64 },
        Kind::Noise { density: 0.1 },
        Kind::Noise { density: 0.35 },
    ];
    println!("{:<26} {:>4} {:>6} {:<14} {:>8} {:>8} {:>8} {:>8}", "map", "N", "length", "method", "p50", "p99", "clear", "max");
    for kind in kinds {
        for n in [120, 300, 512] {
            for length in [f64::INFINITY, 20.0, 7.0] {
                if length.is_finite() && n > 300 { continue; }
                let mut worst = harmonic::testing::Angles::default();
                let mut method = "";
                let mut residual = 0.0_f64;
                for seed in 0..if n == 512 { 1 } else { 3 } {
                    let domain = Map::generate(kind, n, n, seed).domain().expect("a valid map").with_screening(&Screening::cells(length)).expect("ok");
                    let field = Solver::default().solve(&domain, &Cancellation::new()).expect("a field");
                    let exact = harmonic::testing::exact(&domain).expect("a field");
                    let angles = harmonic::testing::Angles::between(&field, &exact, |_| true);
                    worst.p50 = worst.p50.max(angles.p50);
                    worst.p99 = worst.p99.max(angles.p99);
                    worst.max = worst.max.max(angles.max);
                    worst.clear_max = worst.clear_max.max(angles.clear_max);
                    residual = residual.max(field.verification().worst_residual);
                    method = field.verification().method.name();
                }
                println!("{:<26} {n:>4} {length:>6} {method:<14} {:>8.4} {:>8.4} {:>8.3} {:>8.2} {residual:.1e}", format!("{kind:?}"), worst.p50, worst.p99, worst.clear_max, worst.max);
            }
        }
    }
}
