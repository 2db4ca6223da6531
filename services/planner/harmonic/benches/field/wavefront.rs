//! A wavefront as NavFn's, the planner of Nav2, runs one: an upwind distance from the target over flat arrays, cells waiting
//! in two buffers, those that come within a step of the front and those beyond it. Unlike NavFn it has no cap: every cell
//! that can be reached is.

use harmonic::Domain;

use crate::fastest;

/// Distance a step of the front takes in, in cells: more waits in the second buffer.
const STEP: f32 = 2.0;

/// Far enough that a neighbour's distance is not taken up again for rounding.
const LEAST_GAIN: f32 = 1e-3;

/// The wavefront's arrays, kept between runs, framed by blocked cells.
pub(crate) struct Wavefront {
    stride: usize,
    distance: Vec<f32>,
    free: Vec<bool>,
    waiting: Vec<bool>,
    now: Vec<u32>,
    soon: Vec<u32>,
    later: Vec<u32>,
}

impl Wavefront {
    pub(crate) fn new(domain: &Domain) -> Self {
        let stride = domain.width() + 2;
        let len = stride * (domain.height() + 2);
        let mut free = vec![false; len];
        for (row, blocked) in domain.blocked().chunks_exact(domain.width()).enumerate() {
            let row = &mut free[(row + 1) * stride + 1..];
            for (free, blocked) in row.iter_mut().zip(blocked) {
                *free = !blocked;
            }
        }
        Self {
            stride,
            distance: vec![f32::INFINITY; len],
            free,
            waiting: vec![false; len],
            now: Vec::new(),
            soon: Vec::new(),
            later: Vec::new(),
        }
    }

    /// Distances of all cells from the target of `domain`; returns how many were reached.
    pub(crate) fn run(&mut self, domain: &Domain) -> usize {
        let target = domain.target();
        self.distance.fill(f32::INFINITY);
        let start = (target.row + 1) * self.stride + target.col + 1;
        self.distance[start] = 0.0;
        self.push_around(start, 0.0, f32::INFINITY);
        std::mem::swap(&mut self.now, &mut self.soon);
        let mut front = STEP;
        loop {
            while !self.now.is_empty() {
                let now = std::mem::take(&mut self.now);
                for &at in &now {
                    self.waiting[at as usize] = false;
                }
                for &at in &now {
                    self.relax(at as usize, front);
                }
                self.now = now;
                self.now.clear();
                std::mem::swap(&mut self.now, &mut self.soon);
            }
            if self.later.is_empty() {
                break;
            }
            front += STEP;
            std::mem::swap(&mut self.now, &mut self.later);
        }
        self.distance.iter().filter(|it| it.is_finite()).count()
    }

    /// The distance of a cell from those of its neighbours; those it improves wait.
    #[inline(always)]
    fn relax(&mut self, at: usize, front: f32) {
        let d = |at: usize| self.distance[at];
        let across = d(at - 1).min(d(at + 1));
        let along = d(at - self.stride).min(d(at + self.stride));
        let (near, gap) = (across.min(along), (across - along).abs());
        let distance = if gap >= 1.0 {
            near + 1.0
        } else {
            // The plane wave through both.
            near + 0.5 * (gap + (2.0 - gap * gap).sqrt())
        };
        if distance + LEAST_GAIN < self.distance[at] {
            self.distance[at] = distance;
            self.push_around(at, distance, front);
        }
    }

    #[inline(always)]
    fn push_around(&mut self, at: usize, distance: f32, front: f32) {
        for next in [at - 1, at + 1, at - self.stride, at + self.stride] {
            // No cell is nearer to the front than half a diagonal step.
            if self.free[next]
                && !self.waiting[next]
                && self.distance[next] > distance + std::f32::consts::FRAC_1_SQRT_2
            {
                self.waiting[next] = true;
                if distance < front {
                    self.soon.push(next as u32);
                } else {
                    self.later.push(next as u32);
                }
            }
        }
    }
}

/// Milliseconds of the fastest of `runs` wavefronts, and the cells it reached.
pub(crate) fn time(domain: &Domain, runs: usize) -> (f64, usize) {
    let mut wavefront = Wavefront::new(domain);
    let mut reached = 0;
    let time = fastest(runs, || reached = wavefront.run(domain));
    (time, reached)
}
