//! `cargo bench -p firsthand-field --features bench` prints the times of the solver and of other
//! algorithms.
//!
//! Ratios hold only between times measured in turn in one run, so a custom harness replaces
//! criterion. Every time is the least of several runs. Arguments after `--` select the
//! measurements:
//! - `updates` measures only updates.
//! - `accuracy` measures angles instead of times.
//! - `growth` measures time and memory by map size.
//! - `sweep` measures widths of corridors and doors, densities and depths of u, worst first.
//! - `--maps DIR` adds the PGM maps of a directory.
#![allow(
    clippy::expect_used,
    clippy::print_stdout,
    missing_docs,
    reason = "a program for the developer's terminal"
)]

mod accuracy;
mod others;
mod real;
mod split;
#[path = "../../tests/harmonic/support/mod.rs"]
mod support;
mod sweep;
mod updates;
mod wavefront;

use std::time::Instant;

use crate::split::{Measured, measured};
use crate::support::{Kind::*, Map};
use harmonic::{Cell, Domain};

/// Returns the milliseconds of the fastest of `runs` calls.
fn fastest(runs: usize, mut call: impl FnMut()) -> f64 {
    let milliseconds = (0..runs).map(|_| {
        let start = Instant::now();
        call();
        start.elapsed().as_secs_f64() * 1e3
    });
    milliseconds.fold(f64::INFINITY, f64::min)
}

fn runs(cells: usize) -> usize {
    (4_000_000 / cells).clamp(3, 12)
}

fn main() {
    let asked = |word: &str| std::env::args().any(|argument| argument == word);
    if asked("updates") {
        return updates::table();
    }
    if asked(split::BYTES) {
        return split::print_bytes();
    }
    if asked("growth") {
        return split::growth_table();
    }
    if asked("sweep") {
        return sweep::table(&real_maps());
    }
    if asked("accuracy") {
        return accuracy::angle_table();
    }
    full_table();
    for (name, domain) in real_maps() {
        full_row(&name, &domain);
    }
    updates::table();
}

/// Loads the maps of the directory after `--maps`, if any.
fn real_maps() -> Vec<(String, Domain)> {
    let directory = std::env::args().skip_while(|it| it != "--maps").nth(1);
    directory.map(real::load_all).unwrap_or_default()
}

fn full_table() {
    println!(
        "\nFull solves without screening: set-up + solve + verification, ms, and as multiples of a wavefront's time"
    );
    println!(
        "map                          cells method           scratch wavefront      x  dijkstra   log10 u"
    );
    let kinds = [Empty, Drums, Office, Trap]
        .into_iter()
        .chain([1, 4, 8, 16, 32, 64].map(|corridor| Maze { corridor }))
        .chain([Noise { density: 0.35 }])
        .chain([1, 8, 24].map(|corridor| Serpentine { corridor }));
    for kind in kinds {
        full_row(&format!("{kind:?}"), &Map::generate(kind, 512, 512, 1).domain());
    }
}

/// Returns maps of the same size to solve before a timed one, so that memory is reused and the
/// set-up is not.
///
/// The map upside down takes the same precision, and drums take the other.
fn others_than(domain: &Domain) -> [Domain; 2] {
    let (width, height) = (domain.width(), domain.height());
    let rows = domain.blocked().chunks_exact(width).rev();
    let blocked = rows.flatten().copied().collect();
    let target = Cell::new(domain.target().col, height - 1 - domain.target().row);
    let upside_down = support::domain(width, height, blocked, target);
    [upside_down, Map::generate(Drums, width, height, 2).domain()]
}

fn full_row(name: &str, domain: &Domain) {
    let cells = domain.blocked().len();
    let Measured { total: scratch, wavefront, field } = measured(domain, runs(cells));
    let dijkstra = others::dijkstra(domain);
    println!(
        "{name:<24} {:>9} {:<14} {scratch:>9.3} {wavefront:>9.3} {:>6.2} {dijkstra:>9.2} {:>9.1}",
        format!("{}x{}", domain.width(), domain.height()),
        field.verification().method.name(),
        scratch / wavefront,
        field.log10_u_min(),
    );
}
