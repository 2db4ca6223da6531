//! The latency of a tick, datagram in to datagram out, compared with what the bus alone takes.
//!
//! | module | holds |
//! |---|---|
//! | [`Arguments`] | missions and bare hops, in turn |
//! | `hops` | five bare hops between processes |
//! | `busy` | processes that compute meanwhile |
//! | `mission` | a mission whose ticks are measured, and its consumers |
//! | `regime` | how ticks follow each other |
//! | `process_set` | resources of a process and its descendants |
//! | `report` | the result, as it is printed |

mod busy;
mod hops;
mod mission;
mod options;
mod process_set;
mod regime;
mod report;

use common::{domain::RobotName, latency::Histogram};
use console::missions;
use processes::process::{Process, firsthand};

pub use options::Arguments;
use regime::Regime;
use report::Report;

use crate::error::{NOTHING, OrCannot as _, Result};

/// Measure, or be one of the processes that a measurement starts.
pub fn main(arguments: &Arguments) -> Result {
    let robot = match &arguments.robot {
        Some(robot) => robot.clone(),
        None => format!("latency{}", std::process::id()).parse()?,
    };
    if let (Some(role), Some(supervisor)) = (&arguments.role, arguments.supervisor) {
        return match &**role {
            busy::ROLE => busy::run(supervisor),
            mission::CONSUMER => mission::consume(&robot, supervisor),
            place => hops::run_forwarder(&robot, place, supervisor),
        };
    }
    let rate_hz = missions::load(&arguments.mission, &arguments.set)?.robot.rate_hz;
    let busy = (0..arguments.busy).map(|_| start(busy::ROLE, &robot));
    let _busy = busy.collect::<Result<Vec<_>>>()?;
    let regimes = Regime::all(arguments.rate, arguments.pace, rate_hz);
    let reports: Result<Vec<_>> =
        regimes.into_iter().map(|regime| measure(regime, arguments, &robot, rate_hz)).collect();
    reports?.iter().try_for_each(|report| crate::print(report, arguments.json))
}

/// Measure missions of `robot` and hops, in turn. The mission has `rate_hz` ticks in a mission second.
fn measure(
    regime: Regime,
    arguments: &Arguments,
    robot: &RobotName,
    rate_hz: f64,
) -> Result<Report> {
    let (mut hops, mut rounds) = (Histogram::default(), Vec::new());
    for _ in 0..arguments.rounds {
        let round = hops::measure(robot, regime.trips(), regime.period())?;
        hops.add(round.counts(), round.max_ns());
        rounds.push(mission::measure(arguments, robot, regime.pace(rate_hz))?);
    }
    Report::new(regime, &hops, &rounds).ok_or_else(|| NOTHING.into())
}

/// Start this program as the process `role` beside a measurement of `robot`. It ends when it is dropped.
fn start(role: &str, robot: &RobotName) -> Result<Process> {
    let (own, robot) = (std::process::id().to_string(), robot.to_string());
    let beside = ["bench", "tick", "--role", role, "--supervisor", &own, "--robot", &robot];
    Process::spawn(firsthand(&beside)).or_cannot("start a process beside the measurement")
}
