//! Latency histogram that fits in a sample: eight buckets per octave from 1 microsecond, so
//! quantiles are accurate within 9 percent.

/// 24 octaves, up to 16 s.
pub const BUCKETS: usize = 192;
const PER_OCTAVE: f64 = 8.0;

/// Bucket k counts latencies from 2^(k/8) microseconds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Histogram {
    pub counts: [u32; BUCKETS],
    pub max_ns: u64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { counts: [0; BUCKETS], max_ns: 0 }
    }
}

impl Histogram {
    pub fn record(&mut self, latency_ns: u64) {
        let microseconds = (latency_ns as f64 / 1e3).max(1.0);
        let bucket = (microseconds.log2() * PER_OCTAVE) as usize;
        let count = &mut self.counts[bucket.min(BUCKETS - 1)];
        *count = count.saturating_add(1);
        self.max_ns = self.max_ns.max(latency_ns);
    }

    pub fn total(&self) -> u64 {
        self.counts.iter().map(|&count| u64::from(count)).sum()
    }

    pub fn add(&mut self, counts: &[u32; BUCKETS], max_ns: u64) {
        for (own, other) in self.counts.iter_mut().zip(counts) {
            *own = own.saturating_add(*other);
        }
        self.max_ns = self.max_ns.max(max_ns);
    }

    /// Returns the upper end of the quantile's bucket, at most the longest latency.
    pub fn quantile_us(&self, share: f64) -> Option<f64> {
        assert!((0.0..=1.0).contains(&share));
        let total = self.total();
        let rank = ((total as f64 * share).ceil() as u64).min(total).max(1);
        let mut seen = 0;
        let bucket = self.counts.iter().position(|&count| {
            seen += u64::from(count);
            seen >= rank
        })?;
        let end = ((bucket + 1) as f64 / PER_OCTAVE).exp2();
        Some(end.min(self.max_ns as f64 / 1e3))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_right_within_a_bucket_none_is_of_nothing_and_an_age_falls_in_the_last_one() {
        let mut histogram = Histogram::default();
        assert_eq!(histogram.quantile_us(0.5), None);
        for microseconds in 1..=1000_u64 {
            histogram.record(microseconds * 1000);
        }
        for (share, want) in [(0.5, 500.0), (0.99, 990.0)] {
            let got = histogram.quantile_us(share).unwrap();
            assert!((want..want * 1.1).contains(&got), "{share}: {got}");
        }
        assert_eq!(histogram.quantile_us(1.0), Some(1000.0));
        histogram.record(u64::MAX);
        assert_eq!(histogram.counts[BUCKETS - 1], 1);
    }
}
