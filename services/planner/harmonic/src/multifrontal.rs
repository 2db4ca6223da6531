//! Multifrontal factorisation, with the cells in order of decreasing distance from the target.
//!
//! Cells are eliminated from the farthest inwards, a few distances at a time. The eliminated cells
//! form connected pieces, which join as the distance shrinks. The result is a tree of fronts. A
//! front is a small dense matrix over the cells it eliminates and their neighbours nearer to the
//! target.
//!
//! The target is never eliminated, so the elimination has no right-hand side. u follows outwards
//! from u(target) = 1, as sums with moderate positive weights of u nearer to the target. Nothing
//! iterates, cancels or underflows at any range of u. The cost grows with about the cube of the
//! front width, which suits corridors better than halls.

mod back_substitution;
mod breadth_first;
mod dense;
mod gauss_seidel;
mod job;
mod tree;
mod workspace;

use crate::{SolveError, store::Store};

use back_substitution::substitute;

pub(crate) use breadth_first::BreadthFirst;
pub(crate) use gauss_seidel::relax;
pub(crate) use job::Job;
pub(crate) use tree::Tree;
pub(crate) use workspace::Workspace;

pub(crate) type Ordered = (BreadthFirst, Tree);

/// Orders the cells from the target.
pub(crate) fn order(job: Job<'_>) -> Result<Ordered, SolveError> {
    let pass = BreadthFirst::from_target(job)?;
    let tree = Tree::of(&pass, job)?;
    Ok((pass, tree))
}

/// Solves the five-point equations on the map of `job`, exact except for rounding.
///
/// With `known`, solves only the cells that `pass` visits, from the values of its first cells.
pub(crate) fn solve(
    job: Job<'_>,
    ordered: &Ordered,
    known: Option<&Store>,
    workspace: &mut Workspace,
) -> Result<Store, SolveError> {
    let solved =
        factor(job, ordered, workspace).and_then(|()| substitute(job, ordered, known, workspace));
    workspace.trim();
    solved
}

const NOWHERE: u32 = u32::MAX;

fn factor(
    job: Job<'_>,
    (pass, tree): &Ordered,
    workspace: &mut Workspace,
) -> Result<(), SolveError> {
    let Workspace { rows, lengths, slot, .. } = workspace;
    rows.clear();
    rows.reserve(tree.weights);
    lengths.clear();
    lengths.reserve(pass.len());
    slot.clear();
    slot.resize(pass.len(), NOWHERE);
    // Updates wait here for the parent front; spent buffers are reused.
    let mut left: Vec<Vec<f64>> = vec![Vec::new(); tree.fronts.len()];
    let mut spent: Vec<Vec<f64>> = Vec::new();
    let mut slots = Vec::new();
    let mut matrix = dense::Matrix::default();

    for (index, front) in tree.fronts.iter().enumerate() {
        job.cancellation.check()?;
        let cells = tree.cells(front);
        let own = front.own as usize;
        assert!(own <= cells.len());
        for (at, &place) in cells.iter().enumerate() {
            slot[place as usize] = at as u32;
        }
        matrix.reset(cells.len(), own);
        for child in tree.children(front) {
            let boundary = tree.boundary(&tree.fronts[child]);
            slots.clear();
            slots.extend(boundary.iter().map(|&place| slot[place as usize]));
            debug_assert!(!slots.contains(&NOWHERE), "the parent has the child's boundary");
            let update = std::mem::take(&mut left[child]);
            matrix.add_update(&slots, &update);
            spent.push(update);
        }
        for (at, &place) in cells[..own].iter().enumerate() {
            matrix.add(at, at, 4.0 * (1.0 + job.domain.screening_of(pass.cell(place))));
            for neighbour in pass.neighbours(place) {
                // Cells that a child eliminated have no slot here; pairs within the front are met
                // twice.
                let other = slot.get(neighbour as usize).copied().unwrap_or(NOWHERE);
                if other != NOWHERE && other as usize > at {
                    matrix.add(at, other as usize, -1.0);
                }
            }
        }
        matrix.eliminate();
        for row in 0..own {
            let (pivot, rest) = matrix.row(row);
            // The matrix is an M-matrix, so u is a mean of its neighbours with weights.
            assert!(pivot > 0.0);
            debug_assert!(rest.iter().all(|entry| *entry <= 0.0));
            debug_assert!(-rest.iter().sum::<f64>() <= pivot * (1.0 + 1e-6));
            let scale = -1.0 / pivot;
            rows.extend(rest.iter().map(|&entry| entry * scale));
            lengths.push(rest.len() as u32);
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
