//! The result, as it is printed.

use std::fmt;

use common::latency::Histogram;
use serde::Serialize;

use crate::missions::statistics::median;

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
    /// The bare hops, and the tick.
    times: [Times; 2],
    /// Ratio of the medians, tick to bare hops.
    ratio: f64,
    ratio_p99: f64,
    /// Resources of all processes of the mission and the simulated robot; none for a mission of a second or two.
    #[serde(flatten)]
    used: Option<Used>,
}

impl Report {
    /// None without measurements. The medians of the rounds' quantiles count, because the load of a shared machine changes.
    pub fn new(regime: Regime, hops: &Histogram, rounds: &[Ticks]) -> Option<Self> {
        let middle = |of: fn(&Ticks) -> f64| median(rounds.iter().map(of));
        let hops = Times {
            of: "five bare hops on the bus",
            count: hops.total(),
            p50_us: hops.quantile_us(0.5)?,
            p99_us: hops.quantile_us(0.99)?,
            max_us: hops.max_ns() as f64 / 1e3,
        };
        let tick = Times {
            of: "a tick, datagram in to datagram out",
            count: rounds.iter().map(|ticks| ticks.count).sum(),
            p50_us: middle(|tick| tick.p50_us)?,
            p99_us: middle(|tick| tick.p99_us)?,
            max_us: rounds.iter().map(|ticks| ticks.max_us).fold(0.0, f64::max),
        };
        let used =
            |of: fn(&Used) -> f64| median(rounds.iter().filter_map(|it| it.used).map(|it| of(&it)));
        let used = || {
            Some(Used {
                wakeups_per_s: used(|used| used.wakeups_per_s)?,
                cpu_share: used(|used| used.cpu_share)?,
                pss_mib: used(|used| used.pss_mib)?,
            })
        };
        Some(Self {
            regime: regime.to_string(),
            ratio: tick.p50_us / hops.p50_us,
            ratio_p99: tick.p99_us / hops.p99_us,
            times: [hops, tick],
            used: used(),
        })
    }
}

impl fmt::Display for Report {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            to,
            "{:<36} {:>8} {:>10} {:>10} {:>10}",
            self.regime, "count", "p50", "p99", "max"
        )?;
        for Times { of, count, p50_us, p99_us, max_us } in &self.times {
            writeln!(to, "{of:<36} {count:>8} {p50_us:>7.0} us {p99_us:>7.0} us {max_us:>7.0} us")?;
        }
        writeln!(
            to,
            "a tick takes {:.2} times the hops on the bus, {:.2} times at 99 %",
            self.ratio, self.ratio_p99
        )?;
        if let Some(Used { wakeups_per_s, cpu_share, pss_mib }) = self.used {
            let percent = cpu_share * 100.0;
            writeln!(
                to,
                "the mission's processes, supervisor and simulated robot among them: {wakeups_per_s:.0} wakeups a second, \
                 {percent:.1} % of a core, PSS {pss_mib:.0} MiB"
            )?;
        }
        Ok(())
    }
}
