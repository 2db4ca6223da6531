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
pub mod consumers;
pub mod hops;
mod mission;
mod options;
mod process_set;
mod regime;
mod report;

use common::{domain::RobotName, latency::Histogram};

pub use options::Arguments;
pub use report::Report;

use crate::error::BenchError;
use budget::Budget;
use regime::Regime;

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
