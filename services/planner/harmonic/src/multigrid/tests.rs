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
fn the_first_coarse_equations_are_the_galerkin_product() {
    let (levels, domain) = (levels(), domain());
    let mut equations = vec![vec![0.0; 99]; 99];
    for i in (0..99).filter(|&i| !domain.blocked()[i]) {
        equations[i][i] = 4.4;
        let (col, row) = (i % 11, i / 11);
        for j in [(col < 10).then_some(i + 1), (row < 8).then_some(i + 11)].into_iter().flatten() {
            if !domain.blocked()[j] {
                equations[i][j] = -1.0;
                equations[j][i] = -1.0;
            }
        }
    }
    let fine = &levels.finest;
    let interpolation = interpolation(fine);
    assert_equal(&stored(&levels.coarse[0]), &galerkin(&equations, &interpolation));
}

#[test]
fn the_coarser_equations_are_the_galerkin_product() {
    let levels = levels();
    let fine = &levels.coarse[0];
    let interpolation = interpolation(fine);
    assert_equal(&stored(&levels.coarse[1]), &galerkin(&stored(fine), &interpolation));
}

#[test]
fn a_converged_solution_satisfies_every_equation() {
    let (mut levels, domain) = (levels(), domain());
    levels.start(domain.target());
    for _ in 0..40 {
        levels.cycle(None);
    }
    levels.finish();
    let mut u = Vec::new();
    levels.read(domain.target(), -1.0, &mut u);
    let at = |col: isize, row: isize| {
        let inside = (0..11).contains(&col) && (0..9).contains(&row);
        if inside { u[(row * 11 + col) as usize].max(0.0) } else { 0.0 }
    };
    for row in 0..9 {
        for col in 0..11 {
            if (col, row) == (0, 0) || at(col, row) == 0.0 {
                continue;
            }
            let mean =
                (at(col - 1, row) + at(col + 1, row) + at(col, row - 1) + at(col, row + 1)) / 4.4;
            assert!((mean / at(col, row) - 1.0).abs() < 1e-12, "at {col}, {row}");
        }
    }
}
