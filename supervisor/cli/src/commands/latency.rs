//! `firsthand latency`: what a tick takes, compared with what the bus alone takes.

mod budget;
mod consumers;
mod mission;
mod regime;
mod report;

use std::process::ExitCode;

use chaos::ipc_bench;
use clap::Args;
use common::{clock::Pace, domain::RobotName, latency::Histogram};

use super::{Failure, missions, print_text};
use budget::Budget;
use mission::Mission;
use regime::{Regime, parse_hz};
use report::Report;

/// Measure a tick, datagram in to datagram out, and five bare hops between processes.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// The mission whose ticks are measured.
    #[arg(default_value = "open-room")]
    mission: String,
    /// Its pace; the bare hops follow each other as its ticks do.
    #[arg(long, default_value = "max")]
    pace: Pace,
    /// Ticks a second, in place of the pace: 7 is what a robot gets.
    #[arg(long, value_name = "HZ", value_parser = parse_hz, conflicts_with = "pace")]
    rate: Option<f64>,
    /// How often both are measured, in turn: a shared machine has good and bad moments.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rounds: u32,
    /// Also what each stage does with its part of a tick: microseconds by stage and item.
    #[arg(long)]
    budget: bool,
    /// KEY=VALUE over the mission file, as often as needed.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Record the missions meanwhile, as `run` does.
    #[arg(long)]
    record: bool,
    /// Processes that read grid and field of the missions meanwhile, each both.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=16))]
    consumers: u32,
    /// One line of JSON.
    #[arg(long)]
    json: bool,
    /// Name of the robot, which also names its shared memory.
    #[arg(long)]
    robot: Option<RobotName>,
    /// Be the forwarder that stands for this stage.
    #[arg(long, hide = true, requires = "supervisor", requires = "robot")]
    forwarder: Option<String>,
    /// Be a consumer of this robot.
    #[arg(long, hide = true, requires = "supervisor", requires = "robot")]
    consumer: bool,
    /// The parent process: this one stops when it ends.
    #[arg(long, hide = true)]
    supervisor: Option<u32>,
}

/// Samples of a round that follow each other without a pause.
const TRIPS: u64 = 2000;
/// The same with the pause of a tick between them.
const PACED_TRIPS: u64 = 50;

pub(crate) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let robot = match &arguments.robot {
        Some(robot) => robot.clone(),
        None => format!("latency{}", std::process::id()).parse()?,
    };
    if let (true, Some(supervisor)) = (arguments.consumer, arguments.supervisor) {
        consumers::run(&robot, supervisor)?;
        return Ok(ExitCode::SUCCESS);
    }
    if let (Some(place), Some(supervisor)) = (&arguments.forwarder, arguments.supervisor) {
        ipc_bench::run_forwarder(&robot, place, supervisor)?;
        return Ok(ExitCode::SUCCESS);
    }
    let rate_hz = missions::load(&arguments.mission, &arguments.set)?
        .robot
        .rate_hz;
    let regime = Regime::new(arguments.rate, arguments.pace, rate_hz);
    let trips = match regime {
        Regime::BackToBack => TRIPS,
        Regime::Rate { .. } => PACED_TRIPS,
    };
    let mission = Mission {
        name: &arguments.mission,
        set: &arguments.set,
        robot: &robot,
        pace: regime.pace(rate_hz),
        record: arguments.record,
        consumers: arguments.consumers,
    };
    let mut budget = arguments.budget.then(Budget::default);
    let mut hops = Histogram::default();
    let mut rounds = Vec::new();
    for _ in 0..arguments.rounds {
        let round = ipc_bench::measure(&robot, trips, regime.period())?;
        hops.add(round.counts(), round.max_ns());
        rounds.push(mission.measure(budget.as_mut())?);
    }
    let mut report = Report::new(regime, &hops, u64::from(arguments.rounds) * trips, &rounds)
        .ok_or("nothing was measured; does the mission drive at all?")?;
    report.budget = budget.map(Budget::rows);
    if arguments.json {
        print_text(&format!("{}\n", serde_json::to_string(&report)?))?;
    } else {
        print_text(&report.to_string())?;
    }
    Ok(ExitCode::SUCCESS)
}
