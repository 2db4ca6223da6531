//! Sweep over the map shapes that decide the cost of a solve: corridor and door width, obstacle
//! density, depth of u.

use crate::support::{
    Kind::{self, *},
    Map,
};
use harmonic::Domain;

use crate::split::{Measured, measured};

const SIDE: usize = 512;

/// Runs per solve; the fastest counts.
const RUNS: usize = 3;

/// Returns the kinds of maps with their screening lengths.
fn kinds() -> Vec<(Kind, f64)> {
    let mut kinds = vec![Empty, Drums, Office];
    for corridor in [1, 2, 3, 4, 6, 8, 12, 16, 20, 24, 32, 48, 64] {
        kinds.push(Serpentine { corridor });
        kinds.push(Spiral { corridor });
        kinds.push(Maze { corridor });
    }
    for side in [7, 15, 31, 63] {
        let doors = [1, 2, 4, 8, 16].into_iter().filter(|&door| door <= side);
        kinds.extend(doors.map(|door| Rooms { side, door }));
    }
    let densities = [0.01, 0.03, 0.1, 0.2, 0.25, 0.3, 0.35, 0.38, 0.4, 0.45];
    kinds.extend(densities.map(|density| Noise { density }));
    let mut kinds: Vec<_> = kinds.into_iter().map(|kind| (kind, f64::INFINITY)).collect();
    // These lengths lower u across a hall by 1e-3 to 1e-2000.
    for length in [70.0, 20.0, 7.0, 3.0, 1.0, 0.5, 0.1] {
        kinds.extend([Empty, Drums, Office].map(|kind| (kind, length)));
    }
    kinds
}

/// Prints times of each map and of a wavefront measured in turn, worst ratio first.
pub(crate) fn table(real: &[(String, Domain)]) {
    let generated = |(kind, length): (Kind, f64)| {
        let mut name = format!("{kind:?}").replace(" { ", " ").replace(" }", "");
        if length.is_finite() {
            name += &format!(" L {length}");
        }
        row(&name, &Map::generate(kind, SIDE, SIDE, 1).screened(length))
    };
    let mut rows: Vec<_> = kinds().into_iter().map(generated).collect();
    rows.extend(real.iter().map(|(name, domain)| row(name, domain)));
    rows.sort_by(|a, b| b.0.total_cmp(&a.0));
    println!(
        "\nSolves from scratch, {SIDE} x {SIDE} cells, as multiples of a wavefront's time, the worst first"
    );
    println!(
        "map                               x        ms  ms/1e6 method                         log10 u"
    );
    for (_, line) in rows {
        println!("{line}");
    }
}

fn row(name: &str, domain: &Domain) -> (f64, String) {
    let cells = domain.blocked().len() as f64;
    let Measured { total, wavefront, field } = measured(domain, RUNS);
    let ratio = total / wavefront;
    let line = format!(
        "{name:<28} {ratio:>6.2} {total:>9.2} {:>7.1} {:<28} {:>9.1}",
        total * 1e6 / cells,
        field.verification().method.name(),
        field.log10_u_min(),
    );
    (ratio, line)
}
