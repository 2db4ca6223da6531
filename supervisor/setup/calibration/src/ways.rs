//! Nominal distances of the wheels from their counts.

use common::{mission::Body, wire::counts_between};
use serde::{Deserialize, Serialize};

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Ways {
    counts: Option<[u16; 2]>,
    pub left_m: f64,
    pub right_m: f64,
    /// Sum of both distances, each counted as positive.
    pub rolled_m: f64,
}

impl Ways {
    pub(crate) fn step(&mut self, counts: [u16; 2], body: &Body) {
        let before = self.counts.replace(counts).unwrap_or(counts);
        let [left, right] = [0, 1].map(|wheel| {
            f64::from(counts_between(before[wheel], counts[wheel])) * body.metres_per_count()
        });
        self.left_m += left;
        self.right_m += right;
        self.rolled_m += left.abs() + right.abs();
    }

    pub(crate) fn arc_m(&self) -> f64 {
        f64::midpoint(self.left_m, self.right_m)
    }
}
