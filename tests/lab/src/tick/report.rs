//! The result, as it is printed.

use common::latency::Histogram;
use serde::Serialize;

use crate::missions::statistics::{median, rounded};

use super::{mission::Ticks, process_set::Used, regime::Regime};

/// What was measured beside each other, microseconds.
#[derive(Debug, Serialize)]
pub struct Times {
    pub of: &'static str,
    pub count: u64,
    pub p50_us: f64,
    pub p99_us: f64,
    pub max_us: f64,
}

#[derive(Debug, Serialize)]
pub struct Report {
    regime: String,
    /// Ratio of the medians, tick to bare hops.
    ratio: f64,
    ratio_p99: f64,
    /// Resources of all processes of the mission and the simulated robot; none for a mission of a second or two.
    #[serde(flatten)]
    used: Option<Used>,
    /// The bare hops, and the tick.
    times: [Times; 2],
}

impl Report {
    /// None without measurements. The medians of the rounds' quantiles count, because the load of a shared machine changes.
    pub fn new(regime: Regime, hops: &Histogram, rounds: &[Ticks]) -> Option<Self> {
        let middle = |of: fn(&Ticks) -> f64| median(rounds.iter().map(of));
        let hops = Times {
            of: "five bare hops on the bus",
            count: hops.total(),
            p50_us: rounded(hops.quantile_us(0.5)?),
            p99_us: rounded(hops.quantile_us(0.99)?),
            max_us: rounded(hops.max_ns() as f64 / 1e3),
        };
        let tick = Times {
            of: "a tick, datagram in to datagram out",
            count: rounds.iter().map(|ticks| ticks.count).sum(),
            p50_us: rounded(middle(|tick| tick.p50_us)?),
            p99_us: rounded(middle(|tick| tick.p99_us)?),
            max_us: rounds.iter().map(|ticks| ticks.max_us).fold(0.0, f64::max),
        };
        let used =
            |of: fn(&Used) -> f64| median(rounds.iter().filter_map(|it| it.used).map(|it| of(&it)));
        let used = || {
            Some(Used {
                wakeups_per_s: rounded(used(|used| used.wakeups_per_s)?),
                cpu_share: rounded(used(|used| used.cpu_share)?),
                pss_mib: rounded(used(|used| used.pss_mib)?),
            })
        };
        Some(Self {
            regime: regime.to_string(),
            ratio: rounded(tick.p50_us / hops.p50_us),
            ratio_p99: rounded(tick.p99_us / hops.p99_us),
            times: [hops, tick],
            used: used(),
        })
    }
}
