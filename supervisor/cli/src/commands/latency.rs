//! `firsthand latency`: what a tick takes, compared with what the bus alone takes.

use std::{
    fs,
    process::{ExitCode, Stdio},
    time::Duration,
};

use clap::Args;
use common::{clock::Pace, domain::RobotName, latency::Histogram};
use serde::Serialize;

use super::{Failure, missions, print_text};
use chaos::ipc_bench;
use supervisor::process;

/// Measure a tick, datagram in to datagram out, and five bare hops between processes.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// The mission whose ticks are measured.
    #[arg(default_value = "open-room")]
    mission: String,
    /// Its pace; the bare hops follow each other as its ticks do.
    #[arg(long, default_value = "max")]
    pace: Pace,
    /// How often both are measured, in turn: a shared machine has good and bad moments.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rounds: u32,
    /// KEY=VALUE over the mission file, as often as needed.
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

/// Samples of a round that follow each other without a pause.
const TRIPS: u64 = 2000;
/// The same with the pause of a tick between them.
const PACED_TRIPS: u64 = 50;

/// What was measured, microseconds.
#[derive(Debug, Serialize)]
struct Report {
    ticks: u64,
    tick_p50_us: f64,
    tick_p99_us: f64,
    trips: u64,
    hops_p50_us: f64,
    hops_p99_us: f64,
    /// Ratio of the medians, tick to hops.
    ratio: f64,
}

/// One mission's ticks.
struct Ticks {
    count: u64,
    p50_us: f64,
    p99_us: f64,
}

pub(crate) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let robot = match &arguments.robot {
        Some(robot) => robot.clone(),
        None => format!("latency{}", std::process::id()).parse()?,
    };
    if let (Some(place), Some(supervisor)) = (&arguments.forwarder, arguments.supervisor) {
        ipc_bench::run_forwarder(&robot, place, supervisor)?;
        return Ok(ExitCode::SUCCESS);
    }
    let mission = missions::load(&arguments.mission, &arguments.set)?;
    let (trips, period) = match arguments.pace {
        Pace::Max => (TRIPS, None),
        Pace::Rate(rate) => {
            let period = Duration::from_secs_f64(1.0 / (rate * mission.robot.rate_hz));
            (PACED_TRIPS, Some(period))
        }
    };
    let mut hops = Histogram::default();
    let mut ticks = Vec::new();
    for _ in 0..arguments.rounds {
        let round = ipc_bench::measure(&robot, trips, period)?;
        hops.add(round.counts(), round.max_ns());
        ticks.push(measure_ticks(arguments, &robot)?);
    }
    let report = report(&hops, u64::from(arguments.rounds) * trips, &mut ticks)
        .ok_or("nothing was measured; does the mission drive at all?")?;
    if arguments.json {
        print_text(&format!("{}\n", serde_json::to_string(&report)?))?;
    } else {
        print_text(&report.to_string())?;
    }
    Ok(ExitCode::SUCCESS)
}

fn report(hops: &Histogram, trips: u64, ticks: &mut [Ticks]) -> Option<Report> {
    let mut middle = |of: fn(&Ticks) -> f64| {
        ticks.sort_by(|a, b| of(a).total_cmp(&of(b)));
        ticks.get(ticks.len() / 2).map(of)
    };
    let (tick_p50_us, tick_p99_us) = (middle(|tick| tick.p50_us)?, middle(|tick| tick.p99_us)?);
    let hops_p50_us = hops.quantile_us(0.5)?;
    Some(Report {
        ticks: ticks.iter().map(|ticks| ticks.count).sum(),
        tick_p50_us,
        tick_p99_us,
        trips,
        hops_p50_us,
        hops_p99_us: hops.quantile_us(0.99)?,
        ratio: tick_p50_us / hops_p50_us,
    })
}

/// Run the mission.
fn measure_ticks(arguments: &Arguments, robot: &RobotName) -> Result<Ticks, Failure> {
    // Made by this process, so that it may remove it: `firsthand-UID` there is all robots of a user.
    let directory = std::env::temp_dir().join(format!("firsthand-latency-{}", std::process::id()));
    fs::create_dir(&directory)
        .map_err(|error| format!("cannot make {}: {error}", directory.display()))?;
    let (robot, pace) = (robot.to_string(), arguments.pace.to_string());
    let mut command = process::firsthand(&["run", &arguments.mission, "--json", "--pace", &pace]);
    command.args(["--robot", &robot, "--out"]).arg(&directory);
    if !arguments.record {
        command.arg("--no-record");
    }
    for setting in &arguments.set {
        command.args(["--set", setting]);
    }
    let output = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .output()?;
    let _ = fs::remove_dir_all(&directory);
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).map_err(|_| {
        let errors = String::from_utf8_lossy(&output.stderr);
        format!("the mission gave no summary: {}", errors.trim())
    })?;
    let latency = |share| summary["tick_latency_us"][share].as_f64();
    let (Some(p50_us), Some(p99_us)) = (latency("p50"), latency("p99")) else {
        return Err("the mission made no tick".into());
    };
    Ok(Ticks {
        count: summary["ticks"].as_u64().unwrap_or_default(),
        p50_us,
        p99_us,
    })
}

impl std::fmt::Display for Report {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(to, "{:<44} {:>8} {:>10} {:>10}", "", "count", "p50", "p99")?;
        writeln!(
            to,
            "{:<44} {:>8} {:>7.0} us {:>7.0} us",
            "five bare hops between processes", self.trips, self.hops_p50_us, self.hops_p99_us
        )?;
        writeln!(
            to,
            "{:<44} {:>8} {:>7.0} us {:>7.0} us",
            "a tick, datagram in to datagram out", self.ticks, self.tick_p50_us, self.tick_p99_us
        )?;
        writeln!(to, "ratio of the medians {:.2}", self.ratio)
    }
}
