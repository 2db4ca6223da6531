//! Tick latencies of missions whose consumers were hit, and of the same missions without consumers.

use serde::{Serialize, Serializer};
use summary::{Quantiles, Summary};

use crate::missions::statistics::median;

/// Median and 99 % quantile of the ticks of each mission, microseconds; the medians over all missions are written.
#[derive(Debug, Default, Serialize)]
pub struct TickLatencies {
    #[serde(serialize_with = "medians")]
    with_us: Vec<[f64; 2]>,
    #[serde(serialize_with = "medians")]
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

/// The medians of the missions' values.
fn medians<S: Serializer>(missions: &[[f64; 2]], to: S) -> Result<S::Ok, S::Error> {
    let middle = |place: usize| median(missions.iter().map(|it| it[place])).unwrap_or(f64::NAN);
    [middle(0), middle(1)].serialize(to)
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
        let written = serde_json::json!({ "with_us": [21.0, 60.0], "without_us": [20.0, 40.0] });
        assert_eq!(serde_json::to_value(&latencies).unwrap(), written);
    }
}
