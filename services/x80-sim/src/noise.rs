//! Random numbers, one stream per source, so that disabling one leaves the others unchanged.

use rand_pcg::{Pcg64, rand_core::Rng};

pub enum Source {
    Sonar = 1,
    Infrared = 2,
    Wheels = 3,
    Counts = 4,
    Radio = 5,
    WheelErrors = 6,
    Silence = 7,
    Laser = 8,
    Gyro = 9,
}

pub struct Noise(Pcg64);

impl Noise {
    pub fn new(seed: u64, source: Source) -> Self {
        Self::of_nth(seed, source, 0)
    }

    pub fn of_nth(seed: u64, source: Source, nth: usize) -> Self {
        Self(Pcg64::new(u128::from(seed) | (nth as u128) << 64, source as u128))
    }

    /// In [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns a uniform deviate of mean 0, up to `spread` to either side.
    pub fn within(&mut self, spread: f64) -> f64 {
        spread * (2.0 * self.uniform() - 1.0)
    }

    /// Returns a normal deviate of mean 0; draws nothing if `sd` is 0.
    pub fn normal(&mut self, sd: f64) -> f64 {
        if sd <= 0.0 {
            return 0.0;
        }
        // Box-Muller; 1 - u keeps the logarithm finite.
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        let angle = std::f64::consts::TAU * self.uniform();
        sd * radius * angle.cos()
    }

    /// Draws nothing if `mean` is 0.
    pub fn exponential(&mut self, mean: f64) -> f64 {
        if mean <= 0.0 {
            return 0.0;
        }
        -mean * (1.0 - self.uniform()).ln()
    }

    /// Draws nothing if `share` is 0.
    pub fn chance(&mut self, share: f64) -> bool {
        share > 0.0 && self.uniform() < share
    }
}
