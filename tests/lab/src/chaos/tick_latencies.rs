//! Tick latencies of missions whose consumers were hit, and of the same missions without consumers.

use std::fmt;

use serde::Serialize;
use summary::{Quantiles, Summary};

use crate::missions::statistics::median;

/// Median and 99 % quantile of the ticks of each mission, microseconds.
#[derive(Debug, Default, Serialize)]
pub struct TickLatencies {
    with_us: Vec<[f64; 2]>,
    without_us: Vec<[f64; 2]>,
}

impl TickLatencies {
    /// Add the summaries of a mission without consumers and with them.
    pub fn add(&mut self, without: &Summary, with: &Summary) {
        let of = |summary: &Summary| {
            let Quantiles { p50, p99, .. } = summary.tick_latency_us;
            Some([p50?, p99?])
        };
        if let (Some(without), Some(with)) = (of(without), of(with)) {
            self.without_us.push(without);
            self.with_us.push(with);
        }
    }
}

impl fmt::Display for TickLatencies {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let middle = |missions: &[[f64; 2]]| {
            [0, 1].map(|place| median(missions.iter().map(|it| it[place])).unwrap_or(f64::NAN))
        };
        let ([p50, p99], [calm_p50, calm_p99]) = (middle(&self.with_us), middle(&self.without_us));
        write!(
            to,
            "a tick, p50 and p99, medians of {} missions: {p50:.0} and {p99:.0} us with consumers that are hit, \
             {calm_p50:.0} and {calm_p99:.0} us without any",
            self.with_us.len(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_are_of_missions_that_ended_with_a_summary_both_times() {
        let mut latencies = TickLatencies::default();
        let summary = |p50, p99| Summary {
            tick_latency_us: Quantiles { p50: Some(p50), p99: Some(p99), max: None },
            ..Summary::default()
        };
        for us in [10.0, 30.0, 20.0] {
            latencies.add(&summary(us, 2.0 * us), &summary(us + 1.0, 3.0 * us));
        }
        latencies.add(&summary(900.0, 900.0), &Summary::default());
        let said = latencies.to_string();
        assert!(said.contains("3 missions: 21 and 60 us with"), "{said}");
        assert!(said.contains("20 and 40 us without"), "{said}");
    }
}
