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

/// Of y = a x + b z.
#[derive(Clone, Copy, Debug)]
pub struct Two {
    /// Factors, each with its standard deviation.
    pub a: [f64; 2],
    pub b: [f64; 2],
    /// The sum of squares that they leave.
    pub rest: f64,
}

impl Two {
    /// From the sums of x, of z and of their products, if the pairs are so many. None where x and z are alike but for the share `alone`.
    pub fn of(x: &Line, z: &Line, xz: f64, pairs: f64, alone: f64) -> Option<Self> {
        let determinant = x.xx * z.xx - xz * xz;
        (determinant > alone * x.xx * z.xx).then(|| {
            let a = (x.xy * z.xx - z.xy * xz) / determinant;
            let b = (z.xy * x.xx - x.xy * xz) / determinant;
            let rest = (x.yy - a * x.xy - b * z.xy).max(0.0);
            let deviation = |of: f64| (rest / pairs * of / determinant).sqrt();
            Self { a: [a, deviation(z.xx)], b: [b, deviation(x.xx)], rest }
        })
    }
}
