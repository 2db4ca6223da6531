//! The result, as it is printed.

use std::fmt;

use common::latency::Histogram;
use serde::Serialize;

use crate::quantile;

use super::{
    budget::{Row, Table},
    mission::Ticks,
    process_set::Used,
    regime::Regime,
};

/// The result, microseconds.
#[derive(Debug, Serialize)]
pub struct Report {
    /// How ticks and hops followed each other.
    regime: String,
    ticks: u64,
    tick_p50_us: f64,
    tick_p99_us: f64,
    tick_max_us: f64,
    trips: u64,
    hops_p50_us: f64,
    hops_p99_us: f64,
    hops_max_us: f64,
    /// Ratio of the medians, tick to hops.
    ratio: f64,
    /// Ratio at 99 %.
    ratio_p99: f64,
    /// Resources of all processes of the mission and the simulated robot; none for a mission of a second or two.
    wakeups_per_s: Option<f64>,
    cpu_share: Option<f64>,
    pss_mib: Option<f64>,
    /// By stage and item, with `--budget`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) budget: Option<Vec<Row>>,
}

impl Report {
    /// None without measurements. The medians of the rounds' quantiles count, because the load of a shared machine changes.
    pub(super) fn new(
        regime: Regime,
        hops: &Histogram,
        trips: u64,
        rounds: &[Ticks],
    ) -> Option<Self> {
        let middle = |of: fn(&Ticks) -> f64| quantile(rounds.iter().map(of), 0.5);
        let (tick_p50_us, tick_p99_us) = (middle(|tick| tick.p50_us)?, middle(|tick| tick.p99_us)?);
        let (hops_p50_us, hops_p99_us) = (hops.quantile_us(0.5)?, hops.quantile_us(0.99)?);
        let used = |of: fn(&Used) -> f64| {
            quantile(rounds.iter().filter_map(|ticks| ticks.used.as_ref()).map(of), 0.5)
        };
        Some(Self {
            regime: regime.to_string(),
            ticks: rounds.iter().map(|ticks| ticks.count).sum(),
            tick_p50_us,
            tick_p99_us,
            tick_max_us: rounds.iter().map(|ticks| ticks.max_us).fold(0.0, f64::max),
            trips,
            hops_p50_us,
            hops_p99_us,
            hops_max_us: hops.max_ns() as f64 / 1e3,
            ratio: tick_p50_us / hops_p50_us,
            ratio_p99: tick_p99_us / hops_p99_us,
            wakeups_per_s: used(|used| used.wakeups_per_s),
            cpu_share: used(|used| used.cpu_share),
            pss_mib: used(|used| used.pss_mib),
            budget: None,
        })
    }
}

impl fmt::Display for Report {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let row = |to: &mut fmt::Formatter<'_>, what, count, figures: [f64; 3]| {
            let [p50, p99, max] = figures;
            writeln!(to, "{what:<36} {count:>8} {p50:>7.0} us {p99:>7.0} us {max:>7.0} us")
        };
        writeln!(
            to,
            "{:<36} {:>8} {:>10} {:>10} {:>10}",
            self.regime, "count", "p50", "p99", "max"
        )?;
        let hops = [self.hops_p50_us, self.hops_p99_us, self.hops_max_us];
        row(to, "five bare hops between processes", self.trips, hops)?;
        let tick = [self.tick_p50_us, self.tick_p99_us, self.tick_max_us];
        row(to, "a tick, datagram in to datagram out", self.ticks, tick)?;
        writeln!(to, "ratio of the medians {:.2}, at 99 % {:.2}", self.ratio, self.ratio_p99)?;
        if let (Some(wakeups), Some(cpu), Some(pss)) =
            (self.wakeups_per_s, self.cpu_share, self.pss_mib)
        {
            let percent = cpu * 100.0;
            writeln!(
                to,
                "the mission's processes, supervisor and simulated robot among them: {wakeups:.0} wakeups a second, \
                 {percent:.1} % of a core, PSS {pss:.0} MiB"
            )?;
        }
        if let Some(budget) = &self.budget {
            write!(to, "\n{}", Table(budget))?;
        }
        Ok(())
    }
}
