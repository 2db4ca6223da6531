//! Sums of a least-squares fit, which forget.

use serde::{Deserialize, Serialize};

/// Of y = factor x.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Line {
    pub xx: f64,
    pub xy: f64,
    pub yy: f64,
}

impl Line {
    /// Add a pair; the share `left` of those before remains.
    pub fn add(&mut self, left: f64, x: f64, y: f64) {
        for (sum, term) in [(&mut self.xx, x * x), (&mut self.xy, x * y), (&mut self.yy, y * y)] {
            *sum = *sum * left + term;
        }
    }

    /// The factor, and its standard deviation if the pairs are so many.
    pub fn factor(&self, pairs: f64) -> (f64, f64) {
        let factor = self.xy / self.xx;
        let rest = (self.yy - factor * self.xy).max(0.0);
        (factor, (rest / pairs / self.xx).sqrt())
    }
}
