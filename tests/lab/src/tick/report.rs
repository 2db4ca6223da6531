//! The result, as it is printed.

use std::fmt;

use common::latency::Histogram;
use serde::Serialize;

use crate::missions::statistics::quantile;

use super::{mission::Ticks, process_set::Used, regime::Regime};

/// What was measured beside each other, microseconds.
#[derive(Debug, Serialize)]
struct Times {
    of: &'static str,
    count: u64,
    p50_us: f64,
    p99_us: f64,
    max_us: f64,
}

/// The names of the rows of hops, in their order, and of the last row.
const HOPS: [&str; 3] = [
    "five hops by eventfds, without data",
    "five hops by Unix datagrams",
    "five bare hops on the bus",
];
const TICK: &str = "a tick, datagram in to datagram out";

#[derive(Debug, Serialize)]
pub struct Report {
    regime: String,
    /// The hops, those on the bus last, and then the tick.
    times: Vec<Times>,
    /// Ratio of the medians, tick to bare hops on the bus.
    ratio: f64,
    ratio_p99: f64,
    /// Resources of all processes of the mission and the simulated robot; none for a mission of a second or two.
    wakeups_per_s: Option<f64>,
    cpu_share: Option<f64>,
    pss_mib: Option<f64>,
}

impl Report {
    /// None without measurements. The medians of the rounds' quantiles count, because the load of a shared machine changes.
    pub fn new(regime: Regime, hops: &[Histogram; HOPS.len()], rounds: &[Ticks]) -> Option<Self> {
        let middle = |of: fn(&Ticks) -> f64| quantile(rounds.iter().map(of), 0.5);
        let times = HOPS.iter().zip(hops).map(|(of, hops)| {
            Some(Times {
                of,
                count: hops.total(),
                p50_us: hops.quantile_us(0.5)?,
                p99_us: hops.quantile_us(0.99)?,
                max_us: hops.max_ns() as f64 / 1e3,
            })
        });
        let mut times: Vec<Times> = times.collect::<Option<_>>()?;
        let tick = Times {
            of: TICK,
            count: rounds.iter().map(|ticks| ticks.count).sum(),
            p50_us: middle(|tick| tick.p50_us)?,
            p99_us: middle(|tick| tick.p99_us)?,
            max_us: rounds.iter().map(|ticks| ticks.max_us).fold(0.0, f64::max),
        };
        let used = |of: fn(&Used) -> f64| {
            quantile(rounds.iter().filter_map(|ticks| ticks.used.as_ref()).map(of), 0.5)
        };
        let bus = times.last()?;
        let (ratio, ratio_p99) = (tick.p50_us / bus.p50_us, tick.p99_us / bus.p99_us);
        times.push(tick);
        Some(Self {
            regime: regime.to_string(),
            times,
            ratio,
            ratio_p99,
            wakeups_per_s: used(|used| used.wakeups_per_s),
            cpu_share: used(|used| used.cpu_share),
            pss_mib: used(|used| used.pss_mib),
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
        Ok(())
    }
}
