//! Coarsest level of at most a few dozen cells, solved by its inverse.

use super::{
    coarse::Coarse,
    grid::{E, S, SE, SW},
};
use crate::real::Real;

#[derive(Debug, Default)]
pub(super) struct Coarsest {
    cells: Vec<(usize, usize)>,
    /// Inverse matrix, row-major, `cells.len()` squared.
    inverse: Vec<f64>,
    right: Vec<f64>,
}

impl Coarsest {
    pub(super) fn set_up<R: Real>(&mut self, level: &Coarse<R>) {
        let grid = &level.grid;
        self.cells.clear();
        let positions = (0..grid.height).flat_map(|row| (0..grid.width).map(move |col| (col, row)));
        self.cells.extend(positions.map(|(col, row)| grid.locate(col, row)));
        let n = self.cells.len();
        assert!(n <= super::COARSEST_SIDE.pow(2));
        let mut matrix = vec![0.0; n * n];
        for (i, &(plane, at)) in self.cells.iter().enumerate() {
            let inverse = level.inverse[plane][at].wide();
            // Inactive cells keep the identity and a right-hand side of zero.
            matrix[i * n + i] = if inverse > 0.0 { 1.0 / inverse } else { 1.0 };
            let (col, row) = (i % grid.width, i / grid.width);
            for step in [E, S, SE, SW] {
                let (c, r) = (col as isize + step.0, row + step.1 as usize);
                if c >= 0 && (c as usize) < grid.width && r < grid.height {
                    let j = r * grid.width + c as usize;
                    let coupling = level.couplings((plane, at), step, 1)[0].wide();
                    matrix[i * n + j] = -coupling;
                    matrix[j * n + i] = -coupling;
                }
            }
        }
        self.inverse = invert(matrix, n);
        self.right.resize(n, 0.0);
    }

    pub(super) fn solve<R: Real>(&mut self, level: &mut Coarse<R>) {
        for (value, &(plane, at)) in self.right.iter_mut().zip(&self.cells) {
            *value = level.f[plane][at].wide();
        }
        for (row, &(plane, at)) in
            self.inverse.chunks_exact(self.cells.len().max(1)).zip(&self.cells)
        {
            let sum: f64 = row.iter().zip(&self.right).map(|(a, b)| a * b).sum();
            level.u[plane][at] =
                if level.inverse[plane][at] > R::default() { R::of(sum) } else { R::default() };
        }
    }
}

/// Inverts a symmetric positive definite matrix by Gauss-Jordan elimination.
fn invert(mut matrix: Vec<f64>, n: usize) -> Vec<f64> {
    for k in 0..n {
        let pivot = 1.0 / matrix[k * n + k];
        matrix[k * n + k] = 1.0;
        for j in 0..n {
            matrix[k * n + j] *= pivot;
        }
        for i in (0..n).filter(|&i| i != k) {
            let factor = matrix[i * n + k];
            if factor != 0.0 {
                matrix[i * n + k] = 0.0;
                for j in 0..n {
                    matrix[i * n + j] -= factor * matrix[k * n + j];
                }
            }
        }
    }
    matrix
}
