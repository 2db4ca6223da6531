//! From the weights to u, outwards from u(target) = 1, in extended range.

use super::super::breadth::Pass;
use super::tree::Tree;
use crate::domain::Domain;
use crate::field::{BLOCKED, Store};
use crate::scaled::Scaled;

/// Binary orders of magnitude a front may span to be computed in plain `f64` with one common exponent.
const PLAIN_SPAN: i32 = 300;

/// Below this, sums in plain `f64` may have lost terms to underflow.
const PLAIN_LEAST: f64 = 1e-180;

/// u of every cell of `domain`.
pub(super) fn outwards(domain: &Domain, pass: &Pass, tree: &Tree, weights: &[f64]) -> Store {
    // By place: the cells of a front lie close together there.
    let mut u = vec![Scaled::ZERO; pass.order.len()];
    u[0] = Scaled::ONE;
    let mut plain = Vec::new();
    let mut end = weights.len();
    for front in tree.fronts.iter().rev() {
        let cells = tree.cells(front);
        let own = front.own as usize;
        let size = cells.len();
        let len = (0..own).map(|row| size - row - 1).sum::<usize>();
        let rows = &weights[end - len..end];
        end -= len;
        if !in_plain_range(&mut u, cells, own, rows, &mut plain) {
            in_extended_range(&mut u, cells, own, rows);
        }
    }

    let mut mantissas: Vec<f64> = domain
        .blocked()
        .iter()
        .map(|&blocked| if blocked { BLOCKED } else { 0.0 })
        .collect();
    let mut exponents = vec![0; mantissas.len()];
    for (&cell, u) in pass.order.iter().zip(&u) {
        mantissas[cell as usize] = u.mantissa;
        exponents[cell as usize] = u.exponent;
    }
    Store::Extended {
        mantissas,
        exponents,
    }
}

/// The rows of a front's weights, last eliminated first, each with its position.
fn rows_backwards(own: usize, size: usize, rows: &[f64]) -> impl Iterator<Item = (usize, &[f64])> {
    let mut end = rows.len();
    (0..own).rev().map(move |row| {
        let start = end - (size - row - 1);
        let weights = &rows[start..end];
        end = start;
        (row, weights)
    })
}

/// Computes a front with one common exponent; false, with nothing written, if its range is too wide for that.
fn in_plain_range(
    u: &mut [Scaled],
    cells: &[u32],
    own: usize,
    rows: &[f64],
    plain: &mut Vec<f64>,
) -> bool {
    let boundary = cells[own..]
        .iter()
        .map(|&place| u[place as usize])
        .filter(|u| !u.is_zero());
    let (least, largest) = boundary.fold((i32::MAX, i32::MIN), |(low, high), u| {
        (low.min(u.exponent), high.max(u.exponent))
    });
    if largest == i32::MIN || largest - least > PLAIN_SPAN {
        return false;
    }
    plain.clear();
    plain.extend(
        cells
            .iter()
            .map(|&place| u[place as usize].relative_to(largest)),
    );
    for (row, weights) in rows_backwards(own, cells.len(), rows) {
        let sum = dot(weights, &plain[row + 1..]);
        if sum < PLAIN_LEAST {
            return false;
        }
        plain[row] = sum;
    }
    for (&place, &value) in cells[..own].iter().zip(plain.iter()) {
        u[place as usize] = Scaled::new(value, largest);
    }
    true
}

/// Computes a front with an exponent for every term.
fn in_extended_range(u: &mut [Scaled], cells: &[u32], own: usize, rows: &[f64]) {
    for (row, weights) in rows_backwards(own, cells.len(), rows) {
        let terms = || {
            weights
                .iter()
                .zip(&cells[row + 1..])
                .map(|(&weight, &place)| {
                    let u = u[place as usize];
                    Scaled::new(weight * u.mantissa, u.exponent)
                })
        };
        let largest = terms()
            .filter(|term| !term.is_zero())
            .map(|term| term.exponent)
            .max();
        let sum = largest.map_or(Scaled::ZERO, |largest| {
            Scaled::new(
                terms()
                    .filter(|term| !term.is_zero())
                    .map(|term| term.relative_to(largest))
                    .sum(),
                largest,
            )
        });
        u[cells[row] as usize] = sum;
    }
}

/// Scalar product in eight partial sums, which the compiler can keep in vector registers.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a8
        .remainder()
        .iter()
        .zip(b8.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in a8.zip(b8) {
        for (sum, (x, y)) in sums.iter_mut().zip(x.iter().zip(y)) {
            *sum += x * y;
        }
    }
    sums.iter().sum::<f64>() + rest
}
