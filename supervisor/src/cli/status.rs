//! `firsthand status`: what runs.

use std::{
    fmt,
    process::ExitCode,
    time::{Duration, Instant},
};

use clap::Args;
use common::{
    bus::Bus,
    domain::{Domain, RobotName},
    samples::{Order, RosterEntry, StageState, name_str},
    topics,
    waiter::Waiter,
};

use serde::Serialize;

use super::Failure;

/// Show the stages of a robot that runs here: pid, generation, uptime, restarts, ages.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Whose.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// One line of JSON; an age of null is never.
    #[arg(long)]
    json: bool,
}

/// The whole of `status --json`.
#[derive(Serialize)]
struct Status<'a> {
    robot: &'a RobotName,
    supervisor_pid: u32,
    order: &'static str,
    tick: u64,
    mission_time_s: f64,
    stages: Vec<StageStatus<'a>>,
}

/// One stage of it.
#[derive(Serialize)]
struct StageStatus<'a> {
    name: &'a str,
    state: &'static str,
    pid: u32,
    generation: u32,
    restarts: u32,
    uptime_s: Option<f64>,
    beat_age_s: Option<f64>,
    output_age_s: Option<f64>,
}

/// The roster comes five times a second.
const PATIENCE: Duration = Duration::from_secs(2);

#[allow(clippy::print_stdout)]
pub(super) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let bus = Bus::join(&Domain::of(arguments.robot.clone()), "status")?;
    let mut roster = bus.slice_reader(&topics::ROSTER)?;
    let mut waiter = Waiter::default();
    waiter.on(bus.alarm(&topics::ROSTER)?);
    let began = Instant::now();
    let entries = loop {
        if let Some(entries) = roster.take()? {
            break entries;
        }
        if began.elapsed() >= PATIENCE {
            return Err(format!(
                "robot {:?} has a bus but no supervisor that speaks; start it anew with `firsthand run`",
                arguments.robot.to_string()
            )
            .into());
        }
        waiter.wait(PATIENCE)?;
    };
    let header = entries.header();
    let status = Status {
        robot: &arguments.robot,
        supervisor_pid: header.supervisor_pid,
        order: order(Order::from_byte(header.order)),
        tick: header.stamp.tick,
        mission_time_s: header.stamp.time().seconds(),
        stages: entries.iter().map(stage_status).collect(),
    };
    if arguments.json {
        println!("{}", serde_json::to_string(&status)?);
    } else {
        print!("{status}");
    }
    Ok(ExitCode::SUCCESS)
}

fn stage_status(entry: &RosterEntry) -> StageStatus<'_> {
    StageStatus {
        name: name_str(&entry.stage),
        state: state(StageState::from_byte(entry.state)),
        pid: entry.pid,
        generation: entry.generation,
        restarts: entry.restarts,
        uptime_s: seconds(entry.uptime_ns),
        beat_age_s: seconds(entry.beat_age_ns),
        output_age_s: seconds(entry.output_age_ns),
    }
}

const fn order(order: Order) -> &'static str {
    match order {
        Order::Hold => "starting",
        Order::Drive => "driving",
        Order::Stop => "stopping",
    }
}

const fn state(state: StageState) -> &'static str {
    match state {
        StageState::Down => "down",
        StageState::Starting => "starting",
        StageState::Running => "running",
        StageState::BackingOff => "backing off",
        StageState::Stopping => "stopping",
    }
}

impl fmt::Display for Status<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "robot {}: supervisor {}, {}, {:.1} s into the mission",
            self.robot, self.supervisor_pid, self.order, self.mission_time_s
        )?;
        writeln!(
            f,
            "{:<16} {:<12} {:>8} {:>4} {:>9} {:>8} {:>10} {:>11}",
            "stage", "state", "pid", "life", "uptime", "restarts", "last beat", "last output"
        )?;
        for stage in &self.stages {
            writeln!(
                f,
                "{:<16} {:<12} {:>8} {:>4} {:>9} {:>8} {:>10} {:>11}",
                stage.name,
                stage.state,
                stage.pid,
                stage.generation,
                age(stage.uptime_s),
                stage.restarts,
                age(stage.beat_age_s),
                age(stage.output_age_s),
            )?;
        }
        Ok(())
    }
}

/// u64::MAX nanoseconds are never.
fn seconds(nanoseconds: u64) -> Option<f64> {
    (nanoseconds != u64::MAX).then_some(nanoseconds as f64 * 1e-9)
}

/// An age for people.
fn age(seconds: Option<f64>) -> String {
    match seconds {
        None => "never".to_owned(),
        Some(seconds) if seconds < 1.0 => format!("{:.0} ms", seconds * 1e3),
        Some(seconds) => format!("{seconds:.1} s"),
    }
}
