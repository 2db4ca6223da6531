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

/// Prints the worst p50, p99 and maximum angles per kind of map.
pub(crate) fn angle_table() {
    println!(
        "\nDirections of full solves beside exact ones, {MAPS} maps of {SIDE} x {SIDE} cells a row, degrees"
    );
    println!(
        "map                        length method of the last        p50      p99    clear      max  residual    tile"
    );
    for kind in KINDS {
        for length in [f64::INFINITY, 7.0] {
            let mut worst = Angles::default();
            let (mut residual, mut tile, mut method) = (0.0_f64, 0.0_f64, "");
            for seed in 0..MAPS {
                let domain = Map::generate(kind, SIDE, SIDE, seed).screened(length);
                let field = solve(&domain);
                let angles =
                    Angles::between(&field, &solve_exactly(&domain).expect("a field"), CLEAR);
                worst.p50 = worst.p50.max(angles.p50);
                worst.p99 = worst.p99.max(angles.p99);
                worst.max = worst.max.max(angles.max);
                worst.clear_max = worst.clear_max.max(angles.clear_max);
                residual = residual.max(field.verification().worst_residual);
                tile = tile.max(field.verification().worst_tile);
                method = field.verification().method.name();
            }
            println!(
                "{:<26} {length:>6} {method:<20} {:>8.4} {:>8.4} {:>8.3} {:>8.2} {residual:>9.1e} {tile:>7.4}",
                format!("{kind:?}"),
                worst.p50,
                worst.p99,
                worst.clear_max,
                worst.max,
            );
        }
    }
}
