//! Angles between computed and exact directions, after solves from scratch on thousands of maps.

use crate::support::{
    Angles, CLEAR,
    Kind::{self, *},
    Map, solve,
};
use harmonic::solve_exactly;

/// Maps per kind and screening.
const MAPS: u64 = 100;

const SIDE: usize = 128;

const KINDS: [Kind; 10] = [
    Empty,
    Drums,
    Office,
    Trap,
    Maze { corridor: 4 },
    Maze { corridor: 8 },
    Maze { corridor: 32 },
    Serpentine { corridor: 8 },
    Noise { density: 0.1 },
    Noise { density: 0.35 },
];

/// Prints the worst 99 % quantile, and the worst clear angle, per kind of map.
pub(crate) fn angle_table() {
    println!(
        "\nDirections of full solves beside exact ones, {MAPS} maps of {SIDE} x {SIDE} cells a row, degrees"
    );
    println!("map                        length      p99    clear");
    for kind in KINDS {
        for length in [f64::INFINITY, 7.0] {
            let (mut p99, mut clear) = (0.0_f64, 0.0_f64);
            for seed in 0..MAPS {
                let domain = Map::generate(kind, SIDE, SIDE, seed).screened(length);
                let exact = solve_exactly(&domain).expect("a field");
                let angles = Angles::between(&solve(&domain), &exact, CLEAR);
                (p99, clear) = (p99.max(angles.p99), clear.max(angles.clear_max));
            }
            println!("{:<26} {length:>6} {p99:>8.4} {clear:>8.3}", format!("{kind:?}"));
        }
    }
}
