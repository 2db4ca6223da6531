//! Back substitution in extended range: from the factors to u, outwards from the cells with known
//! u.

use super::{Job, Ordered, breadth_first::BreadthFirst, workspace::Workspace};
use crate::{Domain, Scaled, SolveError, store::Store};

/// Binary orders of magnitude up to which a front uses plain `f64` with one common exponent.
const PLAIN_SPAN: i32 = 300;

/// Smallest plain `f64` sum that loses no terms to underflow.
const PLAIN_LEAST: f64 = 1e-180;

/// The first cells of `pass` take u from `known`, or 1 at the target.
pub(super) fn substitute(
    job: Job<'_>,
    (pass, tree): &Ordered,
    known: Option<&Store>,
    workspace: &mut Workspace,
) -> Result<Store, SolveError> {
    let Workspace { rows, lengths, u, .. } = workspace;
    // Sorted by place, the cells of a front lie close together.
    u.clear();
    u.resize(pass.len(), Scaled::ZERO);
    for place in 0..pass.unknown().start {
        u[place as usize] = known.map_or(Scaled::ONE, |known| known.u(pass.cell(place)));
    }
    let mut plain = Vec::new();
    let (mut rows, mut lengths) = (&rows[..], &lengths[..]);
    for front in tree.fronts.iter().rev() {
        job.cancellation.check()?;
        let cells = tree.cells(front);
        let own = front.own as usize;
        let (before, lengths_here) = lengths.split_at(lengths.len() - own);
        lengths = before;
        let taken: u32 = lengths_here.iter().sum();
        let (before, rows_here) = rows.split_at(rows.len() - taken as usize);
        rows = before;
        let here = Rows { rows: rows_here, lengths: lengths_here };
        if !in_plain_range(u, cells, here, &mut plain) {
            in_extended_range(u, cells, here);
        }
    }
    assert!(rows.is_empty() && lengths.is_empty());
    Ok(store(job.domain, pass, u, known))
}

fn store(domain: &Domain, pass: &BreadthFirst, u: &[Scaled], known: Option<&Store>) -> Store {
    let at = |(index, &place): (usize, &u32)| {
        let known = || known.map_or(Scaled::ZERO, |known| known.u(index));
        u.get(place as usize).copied().unwrap_or_else(known)
    };
    let places = (0..domain.height()).flat_map(|row| pass.row(row));
    Store::of(domain.blocked(), places.enumerate().map(at))
}

#[derive(Clone, Copy)]
struct Rows<'a> {
    rows: &'a [f64],
    lengths: &'a [u32],
}

impl<'a> Rows<'a> {
    /// Returns rows and positions, last eliminated first.
    fn backwards(self) -> impl Iterator<Item = (usize, &'a [f64])> {
        let mut rest = self.rows;
        self.lengths.iter().enumerate().rev().map(move |(row, &length)| {
            let (before, weights) = rest.split_at(rest.len() - length as usize);
            rest = before;
            (row, weights)
        })
    }
}

/// Returns false, with nothing written, if the range of the front is too wide.
fn in_plain_range(u: &mut [Scaled], cells: &[u32], rows: Rows<'_>, plain: &mut Vec<f64>) -> bool {
    let own = rows.lengths.len();
    let boundary = cells[own..].iter().map(|&place| u[place as usize]).filter(|u| !u.is_zero());
    let (least, largest) = boundary
        .fold((i32::MAX, i32::MIN), |(low, high), u| (low.min(u.exponent), high.max(u.exponent)));
    if largest == i32::MIN || largest - least > PLAIN_SPAN {
        return false;
    }
    plain.clear();
    plain.resize(own, 0.0);
    plain.extend(cells[own..].iter().map(|&place| u[place as usize].relative_to(largest)));
    for (row, weights) in rows.backwards() {
        let sum = dot(weights, &plain[row + 1..][..weights.len()]);
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

fn in_extended_range(u: &mut [Scaled], cells: &[u32], rows: Rows<'_>) {
    for (row, weights) in rows.backwards() {
        let terms = weights.iter().zip(&cells[row + 1..]).map(|(&weight, &place)| {
            let u = u[place as usize];
            Scaled::new(weight * u.mantissa, u.exponent)
        });
        u[cells[row] as usize] = Scaled::sum(terms);
    }
}

/// Four partial sums fit vector registers.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let ((a4, a_rest), (b4, b_rest)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    for (x, y) in a4.iter().zip(b4) {
        for (sum, (x, y)) in sums.iter_mut().zip(x.iter().zip(y)) {
            *sum += x * y;
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}
