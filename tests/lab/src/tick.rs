//! The latency of a tick, datagram in to datagram out, compared with what the bus alone takes.
//!
//! | module | holds |
//! |---|---|
//! | [`Arguments`] | missions and bare hops, in turn |
//! | [`hops`] | five bare hops between processes |
//! | [`plain_hops`] | the same by eventfds and by datagrams, without the bus |
//! | [`busy`], [`consumers`] | other processes meanwhile |
//! | `mission` | a mission whose ticks are measured |
//! | `regime` | how ticks follow each other |
//! | `process_set` | resources of a process and its descendants |
//! | [`Report`] | the result, as it is printed |

pub mod busy;
pub mod consumers;
pub mod hops;
mod mission;
mod options;
pub mod plain_hops;
mod process_set;
mod regime;
mod report;

use common::{domain::RobotName, latency::Histogram};
use plain_hops::Carrier;

pub use options::Arguments;
pub use report::Report;

use crate::error::{NOTHING, Result};
use console::{missions, output::print};
use regime::Regime;

/// Trips of a round that follow each other without a pause.
const TRIPS: u64 = 2000;
/// Trips of a round with the pause of a tick between them.
const PACED_TRIPS: u64 = 50;

/// Measure, or be one of the processes that a measurement starts.
pub fn main(arguments: &Arguments) -> Result {
    let robot = match &arguments.robot {
        Some(robot) => robot.clone(),
        None => format!("latency{}", std::process::id()).parse()?,
    };
    if let Some(supervisor) = arguments.supervisor {
        return match &arguments.forwarder {
            Some(place) if place == plain_hops::PLAIN => plain_hops::run_forwarder(supervisor),
            Some(place) => hops::run_forwarder(&robot, place, supervisor),
            None if arguments.spin => busy::run(supervisor),
            None => consumers::run(&robot, supervisor),
        };
    }
    let rate_hz = missions::load(&arguments.mission, &arguments.set)?.robot.rate_hz;
    for report in measure(arguments, &robot, rate_hz)? {
        print(&report, arguments.json)?;
    }
    Ok(())
}

/// Measure missions of `robot` and hops, in turn, in each regime that is asked for. The mission has `rate_hz` ticks in a mission second.
fn measure(arguments: &Arguments, robot: &RobotName, rate_hz: f64) -> Result<Vec<Report>> {
    let _busy = busy::start(arguments.busy)?;
    let regimes = Regime::all(arguments.rate, arguments.pace, rate_hz);
    regimes.into_iter().map(|regime| measure_in(regime, arguments, robot, rate_hz)).collect()
}

fn measure_in(
    regime: Regime,
    arguments: &Arguments,
    robot: &RobotName,
    rate_hz: f64,
) -> Result<Report> {
    let trips = match regime {
        Regime::BackToBack => TRIPS,
        Regime::Rate { .. } => PACED_TRIPS,
    };
    let period = regime.period();
    let mut hops = [Histogram::default(), Histogram::default(), Histogram::default()];
    let mut rounds = Vec::new();
    for _ in 0..arguments.rounds {
        let round = [
            plain_hops::measure(Carrier::Eventfd, trips, period)?,
            plain_hops::measure(Carrier::UnixDatagram, trips, period)?,
            hops::measure(robot, trips, period)?,
        ];
        for (all, round) in hops.iter_mut().zip(round) {
            all.add(round.counts(), round.max_ns());
        }
        rounds.push(mission::measure(arguments, robot, regime.pace(rate_hz))?);
    }
    Report::new(regime, &hops, &rounds).ok_or_else(|| NOTHING.into())
}
