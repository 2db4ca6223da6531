//! Tests of the level algebra against dense matrices.

use super::{couplings::Level, grid::EE, sources::interpolation_weights, *};
use crate::Screening;

type Dense = Vec<Vec<f64>>;

fn domain() -> Domain {
    let rows = [
        "...........",
        "..#....##..",
        "..#..#..#..",
        "..#####.#..",
        "........#..",
        "####.####..",
        "....#......",
        ".##.#.####.",
        "....#......",
    ];
    let blocked = rows.iter().flat_map(|row| row.bytes().map(|cell| cell == b'#')).collect();
    let domain = Domain::new(11, 9, blocked, Cell::new(0, 0)).unwrap();
    // This length gives k = 0.1.
    domain.with_screening(&Screening::cells(0.5 / 0.1_f64.sqrt())).unwrap()
}

fn levels() -> Multigrid<f64> {
    let mut levels = Multigrid::default();
    levels.reshape(11, 9);
    levels.set_up_rows(&domain(), 0..9);
    levels
}

fn interpolation(level: &impl Level<f64>) -> Dense {
    let grid = level.grid();
    let mut matrix = vec![vec![0.0; grid.columns * grid.rows]; grid.width * grid.height];
    for row in 0..grid.height {
        for col in 0..grid.width {
            let (plane, at) = grid.locate(col, row);
            for (k, weight) in interpolation_weights(level, plane, at).into_iter().enumerate() {
                let (x, y) = (col / 2 + k % 2, row / 2 + k / 2);
                if weight != 0.0 && (plane != EE || level.inverse()[plane][at] > 0.0) {
                    matrix[row * grid.width + col][y * grid.columns + x] = weight;
                }
            }
        }
    }
    matrix
}

fn galerkin(equations: &Dense, interpolation: &Dense) -> Dense {
    let coarse = interpolation[0].len();
    let mut product = vec![vec![0.0; coarse]; coarse];
    for (i, row) in equations.iter().enumerate() {
        for (j, &a) in row.iter().enumerate().filter(|(_, a)| **a != 0.0) {
            for (c, &p) in interpolation[i].iter().enumerate().filter(|(_, p)| **p != 0.0) {
                for (d, &q) in interpolation[j].iter().enumerate() {
                    product[c][d] += p * a * q;
                }
            }
        }
    }
    product
}

fn stored(level: &Coarse<f64>) -> Dense {
    let grid = &level.grid;
    let mut matrix = vec![vec![0.0; grid.width * grid.height]; grid.width * grid.height];
    for row in 0..grid.height {
        for col in 0..grid.width {
            let (plane, at) = grid.locate(col, row);
            let i = row * grid.width + col;
            matrix[i][i] = level.inverse[plane][at].inverse();
            for (direction, dx, dy) in [(0, 1, 0), (1, 0, 1), (2, 1, 1), (3, -1, 1)] {
                let (x, y) = (col as isize + dx, row + dy);
                if (0..grid.width as isize).contains(&x) && y < grid.height {
                    let j = y * grid.width + x as usize;
                    matrix[i][j] = -level.coupling[direction][plane][at];
                    matrix[j][i] = matrix[i][j];
                }
            }
        }
    }
    matrix
}

fn assert_equal(found: &Dense, expected: &Dense) {
    for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
        for (j, (found, expected)) in found.iter().zip(expected).enumerate() {
            assert!(
                (found - expected).abs() < 1e-12,
                "entry {i}, {j}: {found}, expected {expected}"
            );
        }
    }
}

#[test]
fn coarse_equations_are_the_galerkin_product() {
    let (levels, domain) = (levels(), domain());
    let mut finest = vec![vec![0.0; 99]; 99];
    for i in (0..99).filter(|&i| !domain.blocked()[i]) {
        finest[i][i] = 4.4;
        let (col, row) = (i % 11, i / 11);
        for j in [(col < 10).then_some(i + 1), (row < 8).then_some(i + 11)].into_iter().flatten() {
            if !domain.blocked()[j] {
                finest[i][j] = -1.0;
                finest[j][i] = -1.0;
            }
        }
    }
    let [first, second] = [0, 1].map(|level| stored(&levels.coarse[level]));
    assert_equal(&first, &galerkin(&finest, &interpolation(&levels.finest)));
    assert_equal(&second, &galerkin(&first, &interpolation(&levels.coarse[0])));
}
