//! Time of a solve beside a wavefront's, and growth of time and memory with the map.

use std::process::Command;

use crate::support::{Kind, Map, solve, solve_with};
use harmonic::{Domain, Field, Solver};

use crate::{fastest, others_than, runs, wavefront};

/// Milliseconds of the fastest solve and of the fastest wavefront, and the field.
pub(crate) struct Measured {
    pub total: f64,
    pub wavefront: f64,
    pub field: Field,
}

/// Measures solves from scratch and wavefronts in turn.
pub(crate) fn measured(domain: &Domain, runs: usize) -> Measured {
    let mut solver = Solver::default();
    let others = others_than(domain);
    let (mut total, mut wavefront, mut reached) = (f64::INFINITY, f64::INFINITY, 0);
    for _ in 0..runs {
        for other in &others {
            solve_with(&mut solver, other);
        }
        total = total.min(fastest(1, || drop(solve_with(&mut solver, domain))));
        let (time, cells) = wavefront::time(domain, 2);
        (wavefront, reached) = (wavefront.min(time), cells);
    }
    let field = solve_with(&mut solver, domain);
    assert_eq!(reached, field.verification().reachable, "cells reached");
    Measured { total, wavefront, field }
}

pub(crate) fn growth_table() {
    println!(
        "\nGrowth with the map: ms per million cells, and bytes a cell that a solver and its field hold at most"
    );
    println!("map           N method             ms a million  wavefronts  bytes a cell");
    for kind in [Kind::Drums, Kind::Office] {
        for n in [128, 256, 512, 1024, 2048, 4096] {
            let domain = Map::generate(kind, n, n, 1).domain();
            let bytes = bytes_of_a_process(&format!("{kind:?}:{n}"));
            let Measured { total, wavefront, field } = measured(&domain, runs(n * n));
            let method = field.verification().method.name();
            println!(
                "{:<8} {n:>6} {method:<14} {:>16.2} {:>11.2} {:>13}",
                format!("{kind:?}"),
                total * 1e6 / (n * n) as f64,
                total / wavefront,
                bytes.map_or("-".to_owned(), |it| format!("{:.1}", it / (n * n) as f64)),
            );
        }
    }
}

/// Argument that makes this program solve one map and print [`most_bytes`].
pub(crate) const BYTES: &str = "bytes";

/// Runs [`most_bytes`] in a new process, without memory that was used and freed before.
fn bytes_of_a_process(map: &str) -> Option<f64> {
    let output = Command::new(std::env::current_exe().ok()?).args([BYTES, map]).output().ok()?;
    String::from_utf8(output.stdout).ok()?.trim().parse().ok()
}

pub(crate) fn print_bytes() {
    let map = std::env::args().next_back().unwrap_or_default();
    let domain = [Kind::Drums, Kind::Office].into_iter().find_map(|kind| {
        let n = map.strip_prefix(&format!("{kind:?}:"))?.parse().ok()?;
        Some(Map::generate(kind, n, n, 1).domain())
    });
    if let Some(bytes) = domain.and_then(|domain| most_bytes(&domain)) {
        println!("{bytes}");
    }
}

/// Returns the growth of resident memory during a solve by a new solver; `None` if the system does
/// not report it.
fn most_bytes(domain: &Domain) -> Option<f64> {
    // Resets the peak to the present size.
    std::fs::write("/proc/self/clear_refs", "5").ok()?;
    let before = status("VmRSS:")?;
    solve(domain);
    Some((status("VmHWM:")? - before).max(0.0))
}

/// Returns a line of `/proc/self/status`, in bytes.
fn status(line: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let value = status.lines().find_map(|it| it.strip_prefix(line))?;
    let kilobytes: f64 = value.trim().trim_end_matches("kB").trim().parse().ok()?;
    Some(kilobytes * 1024.0)
}
