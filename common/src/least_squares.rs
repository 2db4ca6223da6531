//! Least-squares sums with exponential forgetting.

use serde::{Deserialize, Serialize};

/// Sums for y = factor x.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Line {
    pub xx: f64,
    pub xy: f64,
    pub yy: f64,
}

impl Line {
    /// `left` scales the previous sums.
    pub fn add(&mut self, left: f64, x: f64, y: f64) {
        assert!((0.0..=1.0).contains(&left));
        self.xx = self.xx * left + x * x;
        self.xy = self.xy * left + x * y;
        self.yy = self.yy * left + y * y;
    }

    /// Returns the factor and its standard deviation for this number of pairs.
    pub fn factor(&self, pairs: f64) -> (f64, f64) {
        let factor = self.xy / self.xx;
        let rest = (self.yy - factor * self.xy).max(0.0);
        (factor, (rest / pairs / self.xx).sqrt())
    }
}

/// Fit of y = a x + b z.
#[derive(Clone, Copy, Debug)]
pub struct Two {
    pub a: [f64; 2],
    pub b: [f64; 2],
    /// Residual sum of squares.
    pub rest: f64,
}

impl Two {
    /// Fits from the sums of x, z and their products, for this number of pairs. `None` if x and z
    /// are collinear up to the share `alone`.
    pub fn of(x: &Line, z: &Line, xz: f64, pairs: f64, alone: f64) -> Option<Self> {
        let determinant = x.xx * z.xx - xz * xz;
        (determinant > alone * x.xx * z.xx).then(|| {
            assert!(pairs > 0.0);
            let a = (x.xy * z.xx - z.xy * xz) / determinant;
            let b = (z.xy * x.xx - x.xy * xz) / determinant;
            let rest = (x.yy - a * x.xy - b * z.xy).max(0.0);
            let deviation = |of: f64| (rest / pairs * of / determinant).sqrt();
            Self { a: [a, deviation(z.xx)], b: [b, deviation(x.xx)], rest }
        })
    }
}
