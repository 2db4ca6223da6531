//! `cargo run --example arrows` draws the direction of the field in each free cell of a small map.
#![allow(clippy::print_stdout, reason = "a program for a terminal")]

use harmonic::{Cancellation, Cell, Domain, Solver};

/// `#` is blocked, `x` the target.
const MAP: [&str; 9] = [
    "#########################",
    "#           #           #",
    "#           #           #",
    "#     #     #     #     #",
    "#     #           #     #",
    "#     #           #     #",
    "#     #     #     #   x #",
    "#     #     #     #     #",
    "#########################",
];
const ARROWS: [char; 8] = ['→', '↘', '↓', '↙', '←', '↖', '↑', '↗'];

fn main() -> Result<(), harmonic::SolveError> {
    let (width, cells) = (MAP[0].len(), MAP.concat().into_bytes());
    let target = cells.iter().position(|cell| *cell == b'x').unwrap_or_default();
    let blocked = cells.iter().map(|cell| *cell == b'#').collect();
    let domain = Domain::new(width, MAP.len(), blocked, Cell::new(target % width, target / width))?;
    let field = Solver::default().solve(&domain, &Cancellation::new())?;
    let arrow = |[along_columns, along_rows]: [f64; 2]| {
        let eighths = along_rows.atan2(along_columns) * 4.0 / std::f64::consts::PI;
        ARROWS[eighths.round().rem_euclid(8.0) as usize]
    };
    for (row, line) in MAP.iter().enumerate() {
        let there = |(col, drawn)| field.direction(Cell::new(col, row)).map_or(drawn, arrow);
        println!("{}", line.chars().enumerate().map(there).collect::<String>());
    }
    println!("worst relative residual {:.1e}", field.verification().worst_residual);
    Ok(())
}
