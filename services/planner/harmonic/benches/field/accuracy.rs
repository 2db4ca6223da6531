//! The angles between computed and exact directions, after solves from scratch on thousands of maps and after long sequences of
//! updates.

use crate::support::{Angles, Kind, Map, Random, follow};
use harmonic::{Cancellation, Cell, Change, Domain, Screening, Solver, solve_exactly};

/// Maps of each kind and screening.
const MAPS: u64 = 100;

/// Side of those maps, cells.
const SIDE: usize = 128;

pub(crate) const KINDS: [Kind; 10] = [
    Kind::Empty,
    Kind::Drums,
    Kind::Office,
    Kind::Trap,
    Kind::Maze { corridor: 4 },
    Kind::Maze { corridor: 8 },
    Kind::Maze { corridor: 32 },
    Kind::Serpentine { corridor: 8 },
    Kind::Noise { density: 0.1 },
    Kind::Noise { density: 0.35 },
];

/// Print the worst angles of each kind of map: the median, the 99th percentile and the maximum over the cells.
pub(crate) fn angle_table() {
    println!(
        "\nDirections of full solves beside exact ones, {MAPS} maps of {SIDE} x {SIDE} cells a row, degrees"
    );
    println!(
        "{:<26} {:>6} {:<20} {:>8} {:>8} {:>8} {:>8} {:>9} {:>7}",
        "map", "length", "method of the last", "p50", "p99", "clear", "max", "residual", "tile"
    );
    for kind in KINDS {
        for length in [f64::INFINITY, 7.0] {
            let mut worst = Angles::default();
            let (mut residual, mut tile, mut method) = (0.0_f64, 0.0_f64, "");
            for seed in 0..MAPS {
                let domain = Map::generate(kind, SIDE, SIDE, seed)
                    .domain()
                    .and_then(|it| it.with_screening(&Screening::cells(length)))
                    .expect("a valid map");
                let field =
                    Solver::default().solve(&domain, &Cancellation::new()).expect("a field");
                let exact = solve_exactly(&domain).expect("a field");
                let angles = Angles::between(&field, &exact);
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

/// The numbers of updates after which the whole map is compared with an exact solution.
const COMPARED_AFTER: [usize; 3] = [30, 300, 1000];

/// Blocks of 3 x 3 cells that appear and vanish at random: angles to the exact directions over the whole map, and of how many
/// updates some cell did not lead to the target.
pub(crate) fn sequence_table(maps: Vec<(String, Domain)>) {
    println!("\nUpdates one after the other, beside exact directions over the whole map, degrees");
    println!(
        "{:<26} {:>8} {:>8} {:>8} {:>8} {:>8} {:>14}",
        "map", "updates", "p50", "p99", "clear", "max", "ascent broken"
    );
    for (name, mut domain) in maps {
        let mut solver = Solver::default();
        let cancellation = Cancellation::new();
        let mut field = solver.solve(&domain, &cancellation).expect("a field");
        let mut random = Random::new(21);
        let mut there: Vec<Vec<Change>> = Vec::new();
        let mut broken = 0;
        for update in 1..=COMPARED_AFTER[2] {
            let vanish = there.len() > 20 && random.unit() < 0.5;
            let changes = if vanish {
                let mut gone = there.swap_remove(random.below(there.len()));
                gone.iter_mut().for_each(|change| change.blocked = false);
                gone
            } else {
                let block = loop {
                    let col = 2 + random.below(domain.width() - 8);
                    let row = 2 + random.below(domain.height() - 8);
                    let block = crate::block(&domain, col, row);
                    if !block.is_empty() && field.is_reachable(Cell::new(col, row)) {
                        break block;
                    }
                };
                there.push(block.clone());
                block
            };
            domain.apply(&changes).expect("valid changes");
            field = solver.solve_near(&domain, &field, &cancellation).expect("a field");
            broken += usize::from(follow(&field) < 1.0);
            if COMPARED_AFTER.contains(&update) {
                let exact = solve_exactly(&domain).expect("a field");
                let angles = Angles::between(&field, &exact);
                println!(
                    "{name:<26} {update:>8} {:>8.4} {:>8.4} {:>8.3} {:>8.2} {broken:>14}",
                    angles.p50, angles.p99, angles.clear_max, angles.max,
                );
            }
        }
    }
}
