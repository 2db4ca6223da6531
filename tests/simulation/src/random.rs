//! Random numbers, determined by a seed and a stream: a draw in one stream leaves the others
//! unchanged.

use std::time::Duration;

use glam::DVec2;
use rand_pcg::{Pcg64, rand_core::Rng as _};

#[derive(Clone, Debug)]
pub struct Random(Pcg64);

impl Default for Random {
    fn default() -> Self {
        Self::new(0, 0)
    }
}

impl Random {
    pub fn new(seed: u64, stream: u128) -> Self {
        Self(Pcg64::new(seed.into(), stream))
    }

    pub fn of_world(seed: u64, kind: u64, number: u64) -> Self {
        Self::new(seed, u128::from(kind) << 64 | u128::from(number))
    }

    pub fn bits(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// Draws from [0, 1).
    pub fn share(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn chance(&mut self, of: f64) -> bool {
        self.share() < of
    }

    pub fn within(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.share()
    }

    pub fn in_range(&mut self, [from, to]: [f64; 2]) -> f64 {
        self.within(from, to)
    }

    /// Draws uniformly in the rectangle of half size `half`.
    pub fn point(&mut self, centre: DVec2, half: DVec2) -> DVec2 {
        let x = self.within(-half.x, half.x);
        let y = self.within(-half.y, half.y);
        centre + DVec2::new(x, y)
    }

    /// Draws from the numbers below `n`; 0 for none.
    pub fn below(&mut self, n: usize) -> usize {
        ((self.share() * n as f64) as usize).min(n.saturating_sub(1))
    }

    /// Draws an exponentially distributed time.
    pub fn exponential(&mut self, mean: Duration) -> Duration {
        mean.mul_f64(-(1.0 - self.share()).ln())
    }
}
