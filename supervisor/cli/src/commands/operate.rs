//! `firsthand stop`, `resume`, `restart`, `kill`, `freeze`, `thaw`: what an operator does to a robot that runs.

use std::{
    fs::File,
    process::ExitCode,
    time::{Duration, Instant},
};

use clap::Args;
use common::{
    bus::Bus,
    clock::{MissionTime, monotonic_ns},
    domain::{Domain, RobotName},
    lock_holders,
    roster::Roster,
    samples::{
        Action, Cause, LinkSample, RequestKind, RequestSample, RosterEntry, RosterHeader, name,
        name_str,
    },
    topics::{self, AnyTopic as _},
    waiter::Waiter,
};
use rustix::process::Signal;
use x80_link::failsafe;

use super::{Failure, error_code::Refused};
use supervisor::stages::{self, Stage};

/// Which robot.
#[derive(Debug, Args)]
pub(crate) struct Robot {
    /// Name of the robot.
    #[arg(
        id = "robot",
        long = "robot",
        value_name = "ROBOT",
        default_value = "x80"
    )]
    name: RobotName,
}

/// Let the robot stand until `firsthand resume`; the mission goes on then. Fails until the encoders say that it rests.
#[derive(Debug, Args)]
pub(crate) struct Stop {
    #[command(flatten)]
    robot: Robot,
}

/// Let a stopped robot go on.
#[derive(Debug, Args)]
pub(crate) struct Resume {
    #[command(flatten)]
    robot: Robot,
}

/// Replace a stage by a new generation; one that died too often and is held is released.
#[derive(Debug, Args)]
pub(crate) struct Restart {
    /// The stage (`firsthand stages`).
    stage: String,
    #[command(flatten)]
    robot: Robot,
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
    robot: Robot,
}

/// Freeze a stage's process: it hangs, as far as others can see.
#[derive(Debug, Args)]
pub(crate) struct Freeze {
    /// The stage (`firsthand stages`), or `supervisor`.
    stage: String,
    #[command(flatten)]
    robot: Robot,
}

/// Let a frozen stage's process go on.
#[derive(Debug, Args)]
pub(crate) struct Thaw {
    /// The stage (`firsthand stages`), or `supervisor`.
    stage: String,
    #[command(flatten)]
    robot: Robot,
}

/// The roster comes five times a second; a frozen supervisor publishes none.
pub(crate) const PATIENCE: Duration = Duration::from_secs(2);

/// A stop that is obeyed is seen within a second; the link sends it five times a second, and tries other means after one.
const REST_PATIENCE: Duration = Duration::from_secs(5);

pub(crate) fn stop(arguments: &Stop) -> Result<ExitCode, Failure> {
    stand(&arguments.robot.name)
}

/// Let the robot stand, and wait until it rests.
pub(crate) fn stand(robot: &RobotName) -> Result<ExitCode, Failure> {
    ask(robot, RequestKind::Stop, "")?;
    await_rest(robot)
}

/// Wait until the link says that it stopped the robot, and the robot's encoders that it rests.
fn await_rest(robot: &RobotName) -> Result<ExitCode, Failure> {
    let bus = Bus::join(&Domain::of(robot.clone()), "operator")?;
    let mut links = bus.reader(&topics::LINK)?;
    let mut waiter = Waiter::default();
    waiter.on(bus.wakeup(&topics::LINK)?);
    let began = Instant::now();
    let mut newest = None;
    while began.elapsed() < REST_PATIENCE {
        newest = links.newest()?.or(newest);
        if newest.as_ref().is_some_and(rests) {
            return Ok(ExitCode::SUCCESS);
        }
        waiter.wait(topics::LINK.restated_every())?;
    }
    let seen = match newest {
        None => "its link says nothing; the robot's timed command has ended".to_owned(),
        Some(link) if link.connected == 0 => {
            "it does not answer, so its rest is not seen; it is told to stand when it does"
                .to_owned()
        }
        Some(link) => format!("{}: it moves", failsafe::name(link.cause())),
    };
    let message = format!(
        "robot {robot} is ordered to stand and was not seen at rest within {} s: {seen}; see `firsthand status`",
        REST_PATIENCE.as_secs()
    );
    Err(Refused::new("not-at-rest", message).into())
}

/// Whether the link has obeyed the operator, or ends the mission, and the robot obeys the link.
fn rests(link: &LinkSample) -> bool {
    let obeys = link.cause() == Cause::OperatorStop || link.action() == Action::End;
    obeys && link.at_rest == 1
}

pub(crate) fn resume(arguments: &Resume) -> Result<ExitCode, Failure> {
    ask(&arguments.robot.name, RequestKind::Resume, "")
}

pub(crate) fn restart(arguments: &Restart) -> Result<ExitCode, Failure> {
    let stage = known(&arguments.stage)?;
    ask(&arguments.robot.name, RequestKind::Restart, stage)
}

pub(crate) fn kill(arguments: &Kill) -> Result<ExitCode, Failure> {
    send(&arguments.robot.name, &arguments.stage, arguments.signal)
}

pub(crate) fn freeze(arguments: &Freeze) -> Result<ExitCode, Failure> {
    send(&arguments.robot.name, &arguments.stage, Signal::STOP)
}

pub(crate) fn thaw(arguments: &Thaw) -> Result<ExitCode, Failure> {
    send(&arguments.robot.name, &arguments.stage, Signal::CONT)
}

/// A stage of the table.
pub(crate) fn known(stage: &str) -> Result<&'static str, Failure> {
    Ok(known_stage(stage)?.name)
}

/// The row of a stage in the table.
pub(crate) fn known_stage(stage: &str) -> Result<&'static Stage, Refused> {
    stages::find(stage).ok_or_else(|| Refused::new("unknown-stage", stages::unknown(stage)))
}

/// Send a request to the supervisor, and wait until it has taken it.
pub(crate) fn ask(robot: &RobotName, kind: RequestKind, stage: &str) -> Result<ExitCode, Failure> {
    let bus = Bus::join(&Domain::of(robot.clone()), "operator")?;
    // Opened first: the confirmation must not be missed.
    let mut roster = Roster::open(&bus)?;
    let mut requests = bus.writer(&topics::REQUESTS, 1)?;
    let id = new_id();
    let request = RequestSample {
        id,
        stage: name(stage),
        kind: kind.into(),
        ..RequestSample::default()
    };
    requests.publish(0, MissionTime::default(), request)?;
    find(&mut roster, robot, |header, _| {
        (header.last_request == id).then_some(ExitCode::SUCCESS)
    })
}

/// An id for a request: no two processes ask in the same nanosecond of one boot with one pid.
pub(crate) fn new_id() -> u64 {
    monotonic_ns() ^ u64::from(std::process::id()) << 40 | 1
}

/// Send a signal to a process of the robot: to who holds the lock that it must hold, and to nobody else.
pub(crate) fn send(robot: &RobotName, stage: &str, signal: Signal) -> Result<ExitCode, Failure> {
    let domain = Domain::of(robot.clone());
    // A frozen supervisor publishes nothing.
    let (pid, lock) = if stage == "supervisor" {
        let holder = domain.supervisor();
        let holder = holder.map_err(|error| format!("cannot see who supervises: {error}"))?;
        (holder, domain.lock_file())
    } else {
        (pid_of(&domain, known(stage)?)?, domain.stages_lock_file())
    };
    let pid = pid.ok_or_else(|| {
        let message = format!(
            "{stage} of robot {robot} has no process at the moment; see `firsthand status`"
        );
        Refused::new("no-process", message)
    })?;
    File::open(&lock)
        .and_then(|lock| lock_holders::signal(pid, &lock, signal))
        .map_err(|error| format!("cannot signal {stage} ({pid}): {error}"))?;
    Ok(ExitCode::SUCCESS)
}

/// The process that the roster names for `stage`.
fn pid_of(domain: &Domain, stage: &str) -> Result<Option<u32>, Failure> {
    let bus = Bus::join(domain, "operator")?;
    find(&mut Roster::open(&bus)?, &domain.robot, |_, entries| {
        let mut entries = entries.iter();
        let entry = entries.find(|entry| name_str(&entry.stage) == stage)?;
        Some((entry.pid != 0).then_some(entry.pid))
    })
}

/// What `find` finds in a roster first.
pub(crate) fn find<T>(
    roster: &mut Roster,
    robot: &RobotName,
    find: impl Fn(&RosterHeader, &[RosterEntry]) -> Option<T>,
) -> Result<T, Failure> {
    let found = roster.find(PATIENCE, find)?;
    found.ok_or_else(|| {
        let message = format!(
            "the supervisor of robot {robot} does not answer; is it frozen? (`firsthand thaw supervisor`)"
        );
        Refused::new("no-answer", message).into()
    })
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
