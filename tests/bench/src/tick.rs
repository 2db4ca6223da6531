//! The latency of a tick, datagram in to datagram out, compared with what the bus alone takes.
//!
//! | module | holds |
//! |---|---|
//! | [`Arguments`], [`measure`] | missions and bare hops, in turn |
//! | [`hops`] | five bare hops between processes |
//! | `mission` | a mission whose ticks are measured |
//! | [`Regime`] | how ticks follow each other |
//! | `budget` | the microseconds of each stage and item |
//! | `process_set` | resources of a process and its descendants |
//! | [`Report`] | the result, as it is printed |

mod budget;
pub mod hops;
mod mission;
mod process_set;
mod regime;
mod report;

use clap::Args;
use common::{clock::Pace, domain::RobotName, latency::Histogram};

pub use report::Report;

use crate::error::BenchError;
use budget::Budget;
use regime::{Regime, parse_hz};

/// Measure a tick, datagram in to datagram out, and five bare hops between processes.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The mission whose ticks are measured.
    #[arg(default_value = "open-room")]
    pub mission: String,
    /// The pace of the mission, at which the bare hops follow each other too.
    #[arg(long, default_value = "max")]
    pub pace: Pace,
    /// Ticks a second instead of the pace; a robot has 7.
    #[arg(long, value_name = "HZ", value_parser = parse_hz, conflicts_with = "pace")]
    pub rate: Option<f64>,
    /// Number of rounds, each of which measures both, because a shared machine has good and bad moments.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub rounds: u32,
    /// Measure also the parts of a tick, in microseconds by stage and item.
    #[arg(long)]
    pub budget: bool,
    /// Set a key of the mission, as often as needed.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Record the missions meanwhile, as `run` does.
    #[arg(long)]
    pub record: bool,
    /// One line of JSON.
    #[arg(long)]
    pub json: bool,
    /// Name of the robot, which also names its shared memory.
    #[arg(long)]
    pub robot: Option<RobotName>,
    /// Be the forwarder that stands for this stage.
    #[arg(long, hide = true, requires = "supervisor", requires = "robot")]
    pub forwarder: Option<String>,
    /// The parent process: this one stops when it ends.
    #[arg(long, hide = true)]
    pub supervisor: Option<u32>,
}

/// Trips of a round that follow each other without a pause.
const TRIPS: u64 = 2000;
/// Trips of a round with the pause of a tick between them.
const PACED_TRIPS: u64 = 50;

/// Measure missions of `robot` and bare hops, in turn. The mission has `rate_hz` ticks in a mission second.
pub fn measure(
    arguments: &Arguments,
    robot: &RobotName,
    rate_hz: f64,
) -> Result<Report, BenchError> {
    let regime = Regime::new(arguments.rate, arguments.pace, rate_hz);
    let trips = match regime {
        Regime::BackToBack => TRIPS,
        Regime::Rate { .. } => PACED_TRIPS,
    };
    let mut budget = arguments.budget.then(Budget::default);
    let mut hops = Histogram::default();
    let mut rounds = Vec::new();
    for _ in 0..arguments.rounds {
        let round = hops::measure(robot, trips, regime.period())?;
        hops.add(round.counts(), round.max_ns());
        rounds.push(mission::measure(arguments, robot, regime.pace(rate_hz), budget.as_mut())?);
    }
    let trips = u64::from(arguments.rounds) * trips;
    let mut report = Report::new(regime, &hops, trips, &rounds).ok_or(BenchError::Nothing)?;
    report.budget = budget.map(Budget::rows);
    Ok(report)
}
