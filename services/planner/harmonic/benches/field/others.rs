//! Other algorithms: Dijkstra's algorithm over eight neighbours, and sparse Cholesky factorisation.

use harmonic::{Cell, Domain};

use crate::fastest;

/// Distances from the target to all cells, by the `pathfinding` crate.
pub(crate) fn dijkstra(domain: &Domain) -> f64 {
    const STRAIGHT: u32 = 1000;
    const DIAGONAL: u32 = 1414;
    let steps: [(isize, isize, u32); 8] = [
        (1, 0, STRAIGHT),
        (-1, 0, STRAIGHT),
        (0, 1, STRAIGHT),
        (0, -1, STRAIGHT),
        (1, 1, DIAGONAL),
        (-1, 1, DIAGONAL),
        (1, -1, DIAGONAL),
        (-1, -1, DIAGONAL),
    ];
    let start = (domain.target().col as u32, domain.target().row as u32);
    fastest(3, || {
        let distances = pathfinding::prelude::dijkstra_all(&start, |&(col, row)| {
            steps.into_iter().filter_map(move |(dx, dy, cost)| {
                let (c, r) = (
                    (col as usize).checked_add_signed(dx)?,
                    (row as usize).checked_add_signed(dy)?,
                );
                (!domain.is_blocked(Cell::new(c, r))).then_some(((c as u32, r as u32), cost))
            })
        });
        std::hint::black_box(distances.len());
    })
}

/// Solves the equations by `faer`'s sparse Cholesky factorisation on one core, in `f64`; cells whose u is below its range are
/// unreached.
pub(crate) fn sparse_cholesky(domain: &Domain) -> f64 {
    use faer::linalg::solvers::Solve;
    use faer::sparse::{SparseColMat, Triplet};
    faer::set_global_parallelism(faer::Par::Seq);
    let width = domain.width();
    let target = domain.target().row * width + domain.target().col;
    let free = |index: usize| !domain.blocked()[index] && index != target;
    let mut place = vec![usize::MAX; domain.blocked().len()];
    let mut unknowns = 0;
    for (index, place) in place.iter_mut().enumerate() {
        if free(index) {
            *place = unknowns;
            unknowns += 1;
        }
    }
    let mut entries = Vec::new();
    let mut right = faer::Mat::<f64>::zeros(unknowns, 1);
    for index in (0..place.len()).filter(|&index| free(index)) {
        entries.push(Triplet::new(place[index], place[index], 4.0));
        for next in domain.neighbours(index).into_iter().flatten() {
            if next == target {
                right[(place[index], 0)] += 1.0;
            } else if free(next) && next < index {
                entries.push(Triplet::new(place[index], place[next], -1.0));
            }
        }
    }
    fastest(1, || {
        let matrix =
            SparseColMat::<usize, f64>::try_new_from_triplets(unknowns, unknowns, &entries)
                .expect("a matrix");
        let factor = matrix.sp_cholesky(faer::Side::Lower).expect("a positive definite matrix");
        std::hint::black_box(factor.solve(&right));
    })
}
