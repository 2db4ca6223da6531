//! `firsthand bench tick`: the time of a tick, and of the bus alone.

use bench::tick::{self, Options, Regime, hops, parse_hz};
use clap::Args;
use common::{clock::Pace, domain::RobotName};

use crate::console::{failure::Failure, missions, output::print};

/// Measure a tick, datagram in to datagram out, and five bare hops between processes.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// The mission whose ticks are measured.
    #[arg(default_value = "open-room")]
    mission: String,
    /// The pace of the mission, at which the bare hops follow each other too.
    #[arg(long, default_value = "max")]
    pace: Pace,
    /// Ticks a second instead of the pace; a robot has 7.
    #[arg(long, value_name = "HZ", value_parser = parse_hz, conflicts_with = "pace")]
    rate: Option<f64>,
    /// Number of rounds, each of which measures both, because a shared machine has good and bad moments.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rounds: u32,
    /// Measure also the parts of a tick, in microseconds by stage and item.
    #[arg(long)]
    budget: bool,
    /// Set a key of the mission, as often as needed.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Record the missions meanwhile, as `run` does.
    #[arg(long)]
    record: bool,
    /// One line of JSON.
    #[arg(long)]
    json: bool,
    /// Name of the robot, which also names its shared memory.
    #[arg(long)]
    robot: Option<RobotName>,
    /// Be the forwarder that stands for this stage.
    #[arg(long, hide = true, requires = "supervisor", requires = "robot")]
    forwarder: Option<String>,
    /// The parent process: this one stops when it ends.
    #[arg(long, hide = true)]
    supervisor: Option<u32>,
}

pub(crate) fn main(arguments: &Arguments) -> Result<(), Failure> {
    let robot = match &arguments.robot {
        Some(robot) => robot.clone(),
        None => format!("latency{}", std::process::id()).parse()?,
    };
    if let (Some(place), Some(supervisor)) = (&arguments.forwarder, arguments.supervisor) {
        return Ok(hops::run_forwarder(&robot, place, supervisor)?);
    }
    let rate_hz = missions::load(&arguments.mission, &arguments.set)?.robot.rate_hz;
    let report = tick::measure(&Options {
        mission: &arguments.mission,
        set: &arguments.set,
        rate_hz,
        robot: &robot,
        regime: Regime::new(arguments.rate, arguments.pace, rate_hz),
        rounds: arguments.rounds,
        budget: arguments.budget,
        record: arguments.record,
    })?;
    Ok(print(&report, arguments.json)?)
}
