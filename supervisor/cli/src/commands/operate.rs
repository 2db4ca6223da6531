//! `firsthand stop`, `resume`, `restart`, `kill`, `freeze`, `thaw`: an operator's hand on a robot that runs.

use std::{
    process::ExitCode,
    time::{Duration, Instant},
};

use clap::Args;
use common::{
    bus::{Bus, SliceReader},
    clock::{MissionTime, monotonic_ns},
    domain::{Domain, RobotName},
    samples::{RequestKind, RequestSample, RosterEntry, RosterHeader, name, name_str},
    topics,
    waiter::Waiter,
};
use rustix::process::{Pid, Signal, kill_process};

use super::Failure;
use supervisor::stages;

/// Whose robot.
#[derive(Debug, Args)]
pub(crate) struct Whose {
    /// Name of the robot.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
}

/// Let the robot stand until `firsthand resume`; the mission goes on then.
#[derive(Debug, Args)]
pub(crate) struct Stop {
    #[command(flatten)]
    whose: Whose,
}

/// Let a robot go on that was told to stop.
#[derive(Debug, Args)]
pub(crate) struct Resume {
    #[command(flatten)]
    whose: Whose,
}

/// Give a stage a fresh life; one that died too often and is held is released.
#[derive(Debug, Args)]
pub(crate) struct Restart {
    /// The stage (`firsthand stages`).
    stage: String,
    #[command(flatten)]
    whose: Whose,
}

/// Send a stage a signal, SIGKILL if no other is named, to see what happens.
#[derive(Debug, Args)]
pub(crate) struct Kill {
    /// The stage (`firsthand stages`), or `supervisor`.
    stage: String,
    /// KILL, TERM, INT, ABRT, STOP or CONT.
    #[arg(long, default_value = "KILL", value_parser = signal)]
    signal: Signal,
    #[command(flatten)]
    whose: Whose,
}

/// Stop a stage's process in its tracks: it hangs, as far as the others can tell.
#[derive(Debug, Args)]
pub(crate) struct Freeze {
    /// The stage (`firsthand stages`), or `supervisor`.
    stage: String,
    #[command(flatten)]
    whose: Whose,
}

/// Let a frozen stage's process go on.
#[derive(Debug, Args)]
pub(crate) struct Thaw {
    /// The stage (`firsthand stages`), or `supervisor`.
    stage: String,
    #[command(flatten)]
    whose: Whose,
}

/// The roster comes five times a second; a frozen supervisor says nothing.
pub(crate) const PATIENCE: Duration = Duration::from_secs(2);

pub(crate) fn stop(arguments: &Stop) -> Result<ExitCode, Failure> {
    ask(&arguments.whose.robot, RequestKind::Stop, "")
}

pub(crate) fn resume(arguments: &Resume) -> Result<ExitCode, Failure> {
    ask(&arguments.whose.robot, RequestKind::Resume, "")
}

pub(crate) fn restart(arguments: &Restart) -> Result<ExitCode, Failure> {
    let stage = known(&arguments.stage)?;
    ask(&arguments.whose.robot, RequestKind::Restart, stage)
}

pub(crate) fn kill(arguments: &Kill) -> Result<ExitCode, Failure> {
    send(&arguments.whose.robot, &arguments.stage, arguments.signal)
}

pub(crate) fn freeze(arguments: &Freeze) -> Result<ExitCode, Failure> {
    send(&arguments.whose.robot, &arguments.stage, Signal::STOP)
}

pub(crate) fn thaw(arguments: &Thaw) -> Result<ExitCode, Failure> {
    send(&arguments.whose.robot, &arguments.stage, Signal::CONT)
}

/// A stage of the table.
pub(crate) fn known(stage: &str) -> Result<&'static str, Failure> {
    match stages::find(stage) {
        Some(stage) => Ok(stage.name),
        None => Err(stages::unknown(stage).into()),
    }
}

/// Say it to the supervisor, and wait until it has heard.
fn ask(robot: &RobotName, kind: RequestKind, stage: &str) -> Result<ExitCode, Failure> {
    let bus = Bus::join(&Domain::of(robot.clone()), "operator")?;
    let mut roster = bus.slice_reader(&topics::ROSTER)?;
    let mut waiter = Waiter::default();
    waiter.on(bus.wakeup(&topics::ROSTER)?);
    let mut requests = bus.writer(&topics::REQUESTS, 1)?;
    let id = fresh_id();
    let request = RequestSample {
        id,
        stage: name(stage),
        kind: kind.into(),
        ..RequestSample::default()
    };
    requests.publish(0, MissionTime::default(), request)?;
    await_roster(&mut roster, &waiter, robot, |header, _| {
        (header.last_request == id).then_some(ExitCode::SUCCESS)
    })
}

/// A name for a request: no two processes ask in the same nanosecond of one boot under one pid.
pub(crate) fn fresh_id() -> u64 {
    monotonic_ns() ^ u64::from(std::process::id()) << 40 | 1
}

/// Send a signal to a process of the robot.
fn send(robot: &RobotName, stage: &str, signal: Signal) -> Result<ExitCode, Failure> {
    let domain = Domain::of(robot.clone());
    // One that is frozen says nothing, so its name is read off the lock it holds.
    let pid = if stage == "supervisor" {
        std::fs::read_to_string(domain.lock_file())
            .ok()
            .and_then(|text| text.trim().parse().ok())
    } else {
        pid_of(&domain, known(stage)?)?
    };
    let pid = pid.and_then(Pid::from_raw).ok_or_else(|| {
        format!("{stage} of robot {robot} has no process at the moment; see `firsthand status`")
    })?;
    kill_process(pid, signal).map_err(|error| format!("cannot signal {stage} ({pid}): {error}"))?;
    Ok(ExitCode::SUCCESS)
}

/// The process that the roster names for `stage`.
fn pid_of(domain: &Domain, stage: &str) -> Result<Option<i32>, Failure> {
    let bus = Bus::join(domain, "operator")?;
    let mut roster = bus.slice_reader(&topics::ROSTER)?;
    let mut waiter = Waiter::default();
    waiter.on(bus.wakeup(&topics::ROSTER)?);
    await_roster(&mut roster, &waiter, &domain.robot, |_, entries| {
        let mut entries = entries.iter();
        let entry = entries.find(|entry| name_str(&entry.stage) == stage)?;
        Some((entry.pid != 0).then_some(entry.pid.cast_signed()))
    })
}

/// Look at each roster until `is_it` finds what it looks for.
pub(crate) fn await_roster<T>(
    roster: &mut SliceReader<RosterHeader, RosterEntry>,
    waiter: &Waiter,
    robot: &RobotName,
    is_it: impl Fn(&RosterHeader, &[RosterEntry]) -> Option<T>,
) -> Result<T, Failure> {
    let began = Instant::now();
    loop {
        while let Some(entries) = roster.take()? {
            if let Some(found) = is_it(entries.header(), &entries) {
                return Ok(found);
            }
        }
        let left = PATIENCE.saturating_sub(began.elapsed());
        if left.is_zero() {
            return Err(format!(
                "the supervisor of robot {robot} does not answer; is it frozen? (`firsthand thaw supervisor`)"
            )
            .into());
        }
        waiter.wait(left)?;
    }
}

/// A signal by its name.
fn signal(text: &str) -> Result<Signal, String> {
    let text = text.strip_prefix("SIG").unwrap_or(text);
    Ok(match text {
        "KILL" => Signal::KILL,
        "TERM" => Signal::TERM,
        "INT" => Signal::INT,
        "ABRT" => Signal::ABORT,
        "STOP" => Signal::STOP,
        "CONT" => Signal::CONT,
        _ => return Err("give KILL, TERM, INT, ABRT, STOP or CONT".to_owned()),
    })
}
