//! `firsthand status`: what runs.

use std::{
    process::ExitCode,
    time::{Duration, Instant},
};

use clap::Args;
use common::{
    bus::Bus,
    domain::{Domain, RobotName},
    samples::{Order, StageState, name_str},
    topics,
    waiter::Waiter,
};

use super::Failure;

/// Show the stages of a robot that runs here: pid, generation, uptime, restarts, ages.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Whose.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
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
    println!(
        "robot {}: supervisor {}, {}",
        arguments.robot,
        header.supervisor_pid,
        match Order::from_byte(header.order) {
            Order::Hold => "starting",
            Order::Drive => "driving",
            Order::Stop => "stopping",
        }
    );
    println!(
        "{:<16} {:<12} {:>8} {:>4} {:>9} {:>8} {:>10} {:>11}",
        "stage", "state", "pid", "life", "uptime", "restarts", "last beat", "last output"
    );
    for entry in entries.iter() {
        println!(
            "{:<16} {:<12} {:>8} {:>4} {:>9} {:>8} {:>10} {:>11}",
            name_str(&entry.stage),
            match StageState::from_byte(entry.state) {
                StageState::Down => "down",
                StageState::Starting => "starting",
                StageState::Running => "running",
                StageState::BackingOff => "backing off",
                StageState::Stopping => "stopping",
            },
            entry.pid,
            entry.generation,
            age(entry.uptime_ns),
            entry.restarts,
            age(entry.beat_age_ns),
            age(entry.output_age_ns),
        );
    }
    Ok(ExitCode::SUCCESS)
}

/// An age for people; u64::MAX is never.
fn age(nanoseconds: u64) -> String {
    match nanoseconds {
        u64::MAX => "never".to_owned(),
        0..1_000_000_000 => format!("{} ms", nanoseconds / 1_000_000),
        _ => format!("{:.1} s", nanoseconds as f64 * 1e-9),
    }
}
