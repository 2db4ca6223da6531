//! Wavefront like that of NavFn, a planner of Nav2: an upwind distance from the target over flat
//! arrays.
//!
//! Waiting cells are buffered: those within a step of the front and those beyond it. Unlike NavFn,
//! it reaches every reachable cell without a cap.

use harmonic::{Cell, Domain};

use crate::{fastest, support::cells};

/// Distance per step of the front, in cells; farther cells wait in the second buffer.
const STEP: f32 = 2.0;

/// Least gain, so that rounding does not repeat a neighbour.
const LEAST_GAIN: f32 = 1e-3;

/// Sets the distance of each reachable cell. The arrays have a frame of blocked cells, and `open`
/// says whether a cell is free and not yet waiting.
fn run(
    target: usize,
    stride: usize,
    distance: &mut [f32],
    open: &mut [bool],
    [now, soon, later]: &mut [Vec<u32>; 3],
) {
    distance.fill(f32::INFINITY);
    distance[target] = 0.0;
    push_around(target, 0.0, stride, distance, open, now);
    let mut front = STEP;
    loop {
        while !now.is_empty() {
            for &at in now.iter() {
                open[at as usize] = true;
            }
            for &at in now.iter() {
                let at = at as usize;
                let around = &distance[at - stride..=at + stride];
                let (north, south) = (around[0], around[2 * stride]);
                let (west, own, east) = (around[stride - 1], around[stride], around[stride + 1]);
                let (across, along) = (west.min(east), north.min(south));
                let (near, gap) = (across.min(along), (across - along).abs());
                // Plane wave through both neighbours, as a parabola; a single neighbour gives a
                // step of 1.
                let step = if gap < 1.0 {
                    std::f32::consts::FRAC_1_SQRT_2 + gap * (0.5 - 0.2071 * gap)
                } else {
                    1.0
                };
                let found = near + step;
                if found + LEAST_GAIN < own {
                    distance[at] = found;
                    let next = if found < front { &mut *soon } else { &mut *later };
                    push_around(at, found, stride, distance, open, next);
                }
            }
            now.clear();
            std::mem::swap(now, soon);
        }
        if later.is_empty() {
            break;
        }
        front += STEP;
        std::mem::swap(now, later);
    }
}

/// Queues the neighbours of a cell that may get nearer: none is nearer than half a diagonal step.
#[inline(always)]
fn push_around(
    at: usize,
    found: f32,
    stride: usize,
    distance: &[f32],
    open: &mut [bool],
    next: &mut Vec<u32>,
) {
    let least = found + std::f32::consts::FRAC_1_SQRT_2;
    for neighbour in [at - stride, at - 1, at + 1, at + stride] {
        if open[neighbour] && distance[neighbour] > least {
            open[neighbour] = false;
            next.push(neighbour as u32);
        }
    }
}

/// Returns milliseconds of the fastest run, and the number of reached cells. Runs reuse the arrays.
pub(crate) fn time(domain: &Domain, runs: usize) -> (f64, usize) {
    let stride = domain.width() + 2;
    let len = stride * (domain.height() + 2);
    let framed = |cell: Cell| (cell.row + 1) * stride + cell.col + 1;
    let (mut distance, mut open) = (vec![f32::INFINITY; len], vec![false; len]);
    for cell in cells(domain.width(), domain.height()) {
        open[framed(cell)] = !domain.is_blocked(cell);
    }
    let mut waiting = [0; 3].map(|_| Vec::with_capacity(len / 8));
    let target = framed(domain.target());
    let time = fastest(runs, || run(target, stride, &mut distance, &mut open, &mut waiting));
    (time, distance.iter().filter(|it| it.is_finite()).count())
}
