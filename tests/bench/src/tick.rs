//! The latency of a tick, datagram in to datagram out, compared with what the bus alone takes.
//!
//! | module | holds |
//! |---|---|
//! | [`Options`], [`measure`] | missions and bare hops, in turn |
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

use common::{domain::RobotName, latency::Histogram};

pub use regime::{Regime, parse_hz};
pub use report::Report;

use crate::error::BenchError;
use budget::Budget;

/// The mission that is measured, and how.
#[derive(Debug)]
pub struct Options<'a> {
    /// A shipped mission or a mission file.
    pub mission: &'a str,
    /// `KEY=VALUE` over it.
    pub set: &'a [String],
    /// Ticks of the mission in a second of mission time.
    pub rate_hz: f64,
    /// The robot, which also names the shared memory.
    pub robot: &'a RobotName,
    /// How ticks and hops follow each other.
    pub regime: Regime,
    /// How often missions and hops are measured, in turn: a shared machine has good and bad moments.
    pub rounds: u32,
    /// Whether each stage's part of a tick is measured too.
    pub budget: bool,
    /// Whether the missions are recorded.
    pub record: bool,
}

/// Trips of a round that follow each other without a pause.
const TRIPS: u64 = 2000;
/// Trips of a round with the pause of a tick between them.
const PACED_TRIPS: u64 = 50;

/// Measure missions and bare hops.
pub fn measure(options: &Options<'_>) -> Result<Report, BenchError> {
    let trips = match options.regime {
        Regime::BackToBack => TRIPS,
        Regime::Rate { .. } => PACED_TRIPS,
    };
    let mut budget = options.budget.then(Budget::default);
    let mut hops = Histogram::default();
    let mut rounds = Vec::new();
    for _ in 0..options.rounds {
        let round = hops::measure(options.robot, trips, options.regime.period())?;
        hops.add(round.counts(), round.max_ns());
        rounds.push(mission::measure(options, budget.as_mut())?);
    }
    let trips = u64::from(options.rounds) * trips;
    let mut report =
        Report::new(options.regime, &hops, trips, &rounds).ok_or(BenchError::Nothing)?;
    report.budget = budget.map(Budget::rows);
    Ok(report)
}
