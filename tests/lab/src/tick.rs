//! Latency of a tick, datagram in to datagram out, compared with the bus alone.

mod busy;
mod hops;
mod mission;
mod process_set;

use std::{thread, time::Duration};

use clap::Args;
use common::{clock::Pace, domain::RobotName, latency::Histogram};
use console::missions;
use process_set::Used;
use serde::Serialize;
use summary::Quantiles;

use crate::{
    error::Result,
    missions::statistics::{median, rounded},
};

/// Measure a tick, datagram in to datagram out, and five bare hops between processes, back to back
/// and at the robot's rate.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Mission whose ticks are measured.
    #[arg(default_value = "obstacle-course")]
    mission: String,
    /// Measure only at this many ticks per second, or back to back: max.
    #[arg(long, value_name = "HZ", value_parser = parse_hz)]
    rate: Option<Hz>,
    /// Number of rounds. Each round measures ticks and bare hops, because the load of a shared
    /// machine varies.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rounds: u32,
    /// Set a mission key; repeatable.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Run the missions without recording; `run` records.
    #[arg(long)]
    no_record: bool,
    /// Number of consumers that read the missions' grid and field meanwhile.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(0..=16))]
    consumers: u32,
    /// Number of threads of ordinary priority that compute meanwhile.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=1000))]
    busy: u32,
    /// Print one line of JSON.
    #[arg(long)]
    json: bool,
    /// Name of the robot and of its shared memory.
    #[arg(long)]
    robot: Option<RobotName>,
    /// Be the forwarder that stands for this stage.
    #[arg(long, hide = true, requires = "supervisor", requires = "robot")]
    forwarder: Option<String>,
    /// Parent process: this one stops when it ends.
    #[arg(long, hide = true)]
    supervisor: Option<u32>,
}

pub fn main(arguments: &Arguments) -> Result {
    let robot = match &arguments.robot {
        Some(robot) => robot.clone(),
        None => format!("latency{}", std::process::id()).parse()?,
    };
    if let (Some(place), Some(supervisor)) = (&arguments.forwarder, arguments.supervisor) {
        return hops::run_forwarder(&robot, place, supervisor);
    }
    let rate_hz = missions::load(&arguments.mission, &arguments.set)?.robot.rate_hz;
    (0..arguments.busy).for_each(|_| drop(thread::spawn(busy::run)));
    let rates = arguments.rate.map_or_else(|| vec![None, Some(rate_hz)], |hz| vec![hz]);
    let reports = rates.into_iter().map(|hz| measure(hz, arguments, &robot, rate_hz));
    let reports = reports.collect::<Result<Vec<_>>>()?;
    reports.iter().try_for_each(|report| crate::print(report, arguments.json))
}

fn measure(hz: Hz, arguments: &Arguments, robot: &RobotName, rate_hz: f64) -> Result<Report> {
    let (mut hops, mut rounds, mut used) = (Histogram::default(), Vec::new(), None);
    let pace = hz.map_or(Pace::Max, |hz| Pace::Rate(hz / rate_hz));
    let period = hz.map(|hz| Duration::from_secs_f64(1.0 / hz));
    let trips = if period.is_some() { PACED_TRIPS } else { TRIPS };
    for _ in 0..arguments.rounds {
        let round = hops::measure(robot, trips, period)?;
        hops.add(&round.counts, round.max_ns);
        let (ticks, its) = mission::measure(arguments, robot, pace)?;
        rounds.push(ticks);
        used = its;
    }
    Report::new(hz, &hops, &rounds, used)
}

/// None if back to back. The rate decides whether caches are warm and cores awake.
type Hz = Option<f64>;

/// Back-to-back trips per round.
const TRIPS: u64 = 2000;
const PACED_TRIPS: u64 = 50;

const SLOWEST_HZ: f64 = 0.1;
/// A tick takes up to a millisecond, so faster rates are back to back.
const FASTEST_HZ: f64 = 1000.0;

fn parse_hz(text: &str) -> Result<Hz, String> {
    match text.parse() {
        _ if text == "max" => Ok(None),
        Ok(hz) if (SLOWEST_HZ..=FASTEST_HZ).contains(&hz) => Ok(Some(hz)),
        _ => Err(format!("{text} is not a rate; give {SLOWEST_HZ} to {FASTEST_HZ} Hz, or max")),
    }
}

#[derive(Serialize)]
struct Times {
    of: &'static str,
    count: u64,
    p50_us: f64,
    p99_us: f64,
    max_us: f64,
}

impl Times {
    fn new(of: &'static str, count: u64, quantiles: Quantiles) -> Result<Self> {
        let Quantiles { p50: Some(p50), p99: Some(p99), max: Some(max) } = quantiles else {
            return Err("no tick was measured; give a mission in which the robot drives".into());
        };
        let [p50_us, p99_us, max_us] = [p50, p99, max].map(rounded);
        Ok(Self { of, count, p50_us, p99_us, max_us })
    }
}

#[derive(Serialize)]
struct Report {
    regime: String,
    ratio: f64,
    ratio_p99: f64,
    /// None for a mission of a second or two.
    #[serde(flatten)]
    used: Option<Used>,
    times: [Times; 2],
}

impl Report {
    /// Reports medians of the rounds' quantiles, because machine load varies.
    fn new(hz: Hz, hops: &Histogram, rounds: &[Times], used: Option<Used>) -> Result<Self> {
        let hops = Times::new("five bare hops on the bus", hops.total(), hops.into())?;
        let quantiles = Quantiles {
            p50: median(rounds.iter().map(|round| round.p50_us)),
            p99: median(rounds.iter().map(|round| round.p99_us)),
            max: rounds.iter().map(|round| round.max_us).reduce(f64::max),
        };
        let count = rounds.iter().map(|round| round.count).sum();
        let tick = Times::new("a tick, datagram in to datagram out", count, quantiles)?;
        Ok(Self {
            regime: hz.map_or("back to back".to_owned(), |hz| format!("at {hz} Hz")),
            ratio: rounded(tick.p50_us / hops.p50_us),
            ratio_p99: rounded(tick.p99_us / hops.p99_us),
            used,
            times: [hops, tick],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_is_a_number_or_max_and_one_that_is_none_is_refused() {
        assert_eq!([parse_hz("7"), parse_hz("max")], [Ok(Some(7.0)), Ok(None)]);
        for text in ["0", "-7", "nan", "inf", "1e9", "seven", ""] {
            assert!(parse_hz(text).is_err(), "{text}");
        }
    }
}
