//! Wavefront like that of NavFn, a planner of Nav2: an upwind distance from the target over flat
//! arrays.
//!
//! Waiting cells are buffered: those within a step of the front and those beyond it. Unlike NavFn,
//! it reaches every reachable cell without a cap.

use harmonic::Domain;

use crate::fastest;

/// Distance per step of the front, in cells; farther cells wait in the second buffer.
const STEP: f32 = 2.0;

/// Least gain, so that rounding does not repeat a neighbour.
const LEAST_GAIN: f32 = 1e-3;

/// Arrays of the wavefront, reused between runs, with a frame of blocked cells.
pub(crate) struct Wavefront {
    stride: usize,
    distance: Vec<f32>,
    /// Whether a cell is free and not yet waiting.
    open: Vec<bool>,
    now: Vec<u32>,
    soon: Vec<u32>,
    later: Vec<u32>,
}

impl Wavefront {
    pub(crate) fn new(domain: &Domain) -> Self {
        let stride = domain.width() + 2;
        let len = stride * (domain.height() + 2);
        let mut open = vec![false; len];
        for (row, blocked) in domain.blocked().chunks_exact(domain.width()).enumerate() {
            let row = &mut open[(row + 1) * stride + 1..];
            for (open, blocked) in row.iter_mut().zip(blocked) {
                *open = !blocked;
            }
        }
        Self {
            stride,
            distance: vec![f32::INFINITY; len],
            open,
            now: Vec::with_capacity(len / 8),
            soon: Vec::with_capacity(len / 8),
            later: Vec::with_capacity(len / 8),
        }
    }

    pub(crate) fn run(&mut self, domain: &Domain) {
        let Self { stride, distance, open, now, soon, later } = self;
        let stride = *stride;
        let (distance, open) = (distance.as_mut_slice(), open.as_mut_slice());
        let target = domain.target();
        distance.fill(f32::INFINITY);
        let start = (target.row + 1) * stride + target.col + 1;
        distance[start] = 0.0;
        push_around(start, 0.0, stride, distance, open, now);
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
                    let (west, own, east) =
                        (around[stride - 1], around[stride], around[stride + 1]);
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

    pub(crate) fn reached(&self) -> usize {
        self.distance.iter().filter(|it| it.is_finite()).count()
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

/// Returns milliseconds of the fastest run, and the number of reached cells.
pub(crate) fn time(domain: &Domain, runs: usize) -> (f64, usize) {
    let mut wavefront = Wavefront::new(domain);
    let time = fastest(runs, || wavefront.run(domain));
    (time, wavefront.reached())
}
