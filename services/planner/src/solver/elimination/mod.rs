//! Elimination in order of decreasing distance from the target.
//!
//! Cells are eliminated from the farthest inwards, a few distances at a time. What has been eliminated beyond a distance
//! falls into connected pieces, and pieces join as the distance shrinks: a tree of fronts, each a small dense matrix over
//! the cells it eliminates and their neighbours nearer to the target. The target itself is never eliminated, so there is no
//! right-hand side to carry inwards, and u follows outwards from u(target) = 1: each cell's u is a sum, with positive
//! weights of moderate size, of the u of cells nearer to the target. Nothing is iterated, nothing cancels and nothing
//! underflows, whatever the range of u. The cost is about the cube of the fronts' width: right for corridors, not halls.
//!
//! - [`tree`]: which cells go together, and in what order where many passages run side by side.
//! - [`dense`]: the matrix of a front.
//! - [`substitution`]: from the weights to u.
//! - [`polish`]: what `f64` weights can lose.

mod dense;
mod polish;
mod substitution;
mod tree;

use super::breadth::Pass;
use crate::cancellation::Cancellation;
use crate::domain::{Absorption, Domain};
use crate::error::SolveError;
use crate::field::Store;
use crate::scaled::Scaled;
pub(super) use polish::polish;
pub(super) use tree::Tree;

/// The solution of the five-point equations on `domain`, exact but for rounding.
pub(super) fn solve(
    domain: &Domain,
    pass: &Pass,
    tree: &Tree,
    memory_limit: u64,
    memory: &mut Memory,
    cancellation: &Cancellation,
) -> Result<Store, SolveError> {
    if tree.price.bytes > memory_limit {
        return Err(SolveError::TooCostly {
            needed: tree.price.bytes,
            allowed: memory_limit,
        });
    }
    let solved = factor(domain, pass, tree, memory, cancellation)
        .and_then(|()| substitution::outwards(domain, pass, tree, memory, cancellation));
    memory.give_back();
    solved
}

/// Memory kept between solves: to be given fresh pages costs as much as to fill them.
#[derive(Debug, Default)]
pub(super) struct Memory {
    weights: Weights,
    /// Slot in the front at hand of each place; all `NOWHERE` between fronts.
    slot: Vec<u32>,
    /// u by place.
    u: Vec<Scaled>,
}

/// Memory that is kept at most, bytes: what a maze of half a million cells takes. A map that needs more takes so long
/// that fresh pages no longer count.
const KEPT: usize = 64 << 20;

impl Memory {
    fn give_back(&mut self) {
        let bytes = size_of::<f64>() * self.weights.rows.capacity()
            + size_of::<u32>() * (self.weights.lengths.capacity() + self.slot.capacity())
            + size_of::<Scaled>() * self.u.capacity();
        if bytes > KEPT {
            *self = Self::default();
        }
    }
}

/// What the substitution needs of the factors.
#[derive(Debug, Default)]
struct Weights {
    /// Of every eliminated cell, the weights of the cells after it in its front, up to the last that is not zero.
    rows: Vec<f64>,
    /// How many those are.
    lengths: Vec<u32>,
}

/// The cell is not part of the front.
const NOWHERE: u32 = u32::MAX;

/// The weights of all fronts.
fn factor(
    domain: &Domain,
    pass: &Pass,
    tree: &Tree,
    memory: &mut Memory,
    cancellation: &Cancellation,
) -> Result<(), SolveError> {
    let Memory { weights, slot, .. } = memory;
    weights.rows.clear();
    weights.rows.reserve(tree.price.weights);
    weights.lengths.clear();
    weights.lengths.reserve(pass.len());
    slot.clear();
    slot.resize(pass.len(), NOWHERE);
    // What each front leaves on its boundary, until its parent takes it in; spent buffers are used again.
    let mut left: Vec<Vec<f64>> = vec![Vec::new(); tree.fronts.len()];
    let mut spent: Vec<Vec<f64>> = Vec::new();
    let mut slots = Vec::new();
    let mut matrix = dense::Matrix::default();

    for (index, front) in tree.fronts.iter().enumerate() {
        cancellation.check()?;
        let cells = tree.cells(front);
        let own = front.own as usize;
        for (at, &place) in cells.iter().enumerate() {
            slot[place as usize] = at as u32;
        }
        matrix.reset(cells.len(), own);
        for child in tree.children(front) {
            let boundary = tree.boundary(&tree.fronts[child]);
            slots.clear();
            slots.extend(boundary.iter().map(|&place| slot[place as usize]));
            let update = std::mem::take(&mut left[child]);
            matrix.add_update(&slots, &update);
            spent.push(update);
        }
        for (at, &place) in cells[..own].iter().enumerate() {
            let absorption = match domain.absorption() {
                Absorption::Uniform(k) => *k,
                Absorption::PerCell(_) => domain.absorption_at(pass.cell(place)),
            };
            matrix.add(at, at, 4.0 * (1.0 + absorption));
            for neighbour in pass.neighbours(place) {
                // Cells eliminated before, in a child, have no slot here; pairs within the front are met twice.
                let other = slot.get(neighbour as usize).copied().unwrap_or(NOWHERE);
                if other != NOWHERE && other as usize > at {
                    matrix.add(at, other as usize, -1.0);
                }
            }
        }
        matrix.eliminate();
        for row in 0..own {
            let (pivot, rest) = matrix.row(row);
            let scale = -1.0 / pivot;
            weights.rows.extend(rest.iter().map(|&entry| entry * scale));
            weights.lengths.push(rest.len() as u32);
        }
        if front.has_parent {
            let mut update = spent.pop().unwrap_or_default();
            update.clear();
            matrix.copy_rest(&mut update);
            left[index] = update;
        }
        for &place in cells {
            slot[place as usize] = NOWHERE;
        }
    }
    Ok(())
}
