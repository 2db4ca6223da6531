//! Random numbers for worlds: a seed always gives the same worlds.

use glam::DVec2;
use rand_pcg::{Pcg64, rand_core::Rng as _};

#[derive(Clone, Debug)]
pub(super) struct Random(Pcg64);

impl Random {
    /// The stream of world `number` of the kind `kind` under `seed`.
    pub(super) fn new(seed: u64, kind: u64, number: u64) -> Self {
        Self(Pcg64::new(u128::from(seed), u128::from(kind) << 64 | u128::from(number)))
    }

    /// A number that is uniform in [0, 1).
    pub(super) fn share(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A number that is uniform in [`from`, `to`).
    pub(super) fn within(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.share()
    }

    /// A point that is uniform over the square of half side `half` around `centre`.
    pub(super) fn point(&mut self, centre: DVec2, half: DVec2) -> DVec2 {
        let x = self.within(-half.x, half.x);
        let y = self.within(-half.y, half.y);
        centre + DVec2::new(x, y)
    }

    /// One of 0 to `n` - 1.
    pub(super) fn below(&mut self, n: usize) -> usize {
        ((self.share() * n as f64) as usize).min(n.saturating_sub(1))
    }
}
