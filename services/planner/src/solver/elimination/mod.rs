//! Elimination in order of decreasing distance from the target.
//!
//! Cells are eliminated from the farthest inwards, a few distances at a time. What has been eliminated beyond a distance
//! falls into connected pieces, and pieces join as the distance shrinks: a tree of fronts, each a small dense matrix over
//! the cells it eliminates and their neighbours nearer to the target. The target itself is never eliminated, so there is no
//! right-hand side to carry inwards, and u follows outwards from u(target) = 1: each cell's u is a sum, with positive
//! weights of moderate size, of the u of cells nearer to the target. Nothing is iterated, nothing cancels and nothing
//! underflows, whatever the range of u. The cost is about the cube of the fronts' width: right for corridors, not halls.

mod dense;
mod polish;
mod substitution;
mod tree;

use super::breadth::Pass;
use crate::cancellation::Cancellation;
use crate::domain::Domain;
use crate::error::SolveError;
use crate::field::Store;
pub(super) use polish::polish;
pub(super) use tree::Tree;

/// The solution of the five-point equations on `domain`, exact but for rounding.
pub(super) fn solve(
    domain: &Domain,
    pass: &Pass,
    tree: &Tree,
    memory_limit: u64,
    cancellation: &Cancellation,
) -> Result<Store, SolveError> {
    if tree.price.bytes > memory_limit {
        return Err(SolveError::TooCostly {
            needed: tree.price.bytes,
            allowed: memory_limit,
        });
    }
    let weights = factor(domain, pass, tree, cancellation)?;
    Ok(substitution::outwards(domain, pass, tree, &weights))
}

/// The weights of every eliminated cell on the later cells of its front, front after front, row after row.
fn factor(
    domain: &Domain,
    pass: &Pass,
    tree: &Tree,
    cancellation: &Cancellation,
) -> Result<Vec<f64>, SolveError> {
    const NOWHERE: u32 = u32::MAX;
    let mut weights = Vec::with_capacity(tree.price.weights);
    // What each front leaves on its boundary, until its parent takes it in; spent buffers are used again.
    let mut left: Vec<Vec<f64>> = vec![Vec::new(); tree.fronts.len()];
    let mut spent: Vec<Vec<f64>> = Vec::new();
    let mut slot = vec![NOWHERE; pass.order.len()];
    let mut matrix = dense::Matrix::default();

    for (index, front) in tree.fronts.iter().enumerate() {
        if index % 64 == 0 {
            cancellation.check()?;
        }
        let cells = tree.cells(front);
        let own = front.own as usize;
        for (at, &place) in cells.iter().enumerate() {
            slot[place as usize] = at as u32;
        }
        matrix.reset(cells.len());
        for child in tree.children(index) {
            let boundary = tree.boundary(&tree.fronts[child]);
            let update = std::mem::take(&mut left[child]);
            let mut entries = update.iter();
            for (at, &place) in boundary.iter().enumerate() {
                let row = slot[place as usize] as usize;
                for (&other, &value) in boundary[at..].iter().zip(&mut entries) {
                    matrix.add(row, slot[other as usize] as usize, value);
                }
            }
            spent.push(update);
        }
        for (at, &place) in cells[..own].iter().enumerate() {
            let cell = pass.order[place as usize];
            matrix.add(at, at, 4.0 * (1.0 + domain.absorption_at(cell as usize)));
            for neighbour in pass.neighbours(cell) {
                // Cells eliminated before, in a child, have no slot here; pairs within the front are met twice.
                let other = slot.get(neighbour as usize).copied().unwrap_or(NOWHERE);
                if other != NOWHERE && other as usize > at {
                    matrix.add(at, other as usize, -1.0);
                }
            }
        }
        matrix.eliminate(own);
        for row in 0..own {
            let (pivot, rest) = matrix.row(row);
            let scale = -1.0 / pivot;
            weights.extend(rest.iter().map(|&entry| entry * scale));
        }
        let mut update = spent.pop().unwrap_or_default();
        update.clear();
        if front.parent.is_some() {
            matrix.copy_upper(own, &mut update);
        }
        left[index] = update;
        for &place in cells {
            slot[place as usize] = NOWHERE;
        }
    }
    Ok(weights)
}
