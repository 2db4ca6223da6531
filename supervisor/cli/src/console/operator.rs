//! The operator's part: requests to the supervisor of a robot, signals to its processes.

use std::{
    fs::File,
    time::{Duration, Instant},
};

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
use supervisor::stages::{self, Stage};

use super::failure::{Failure, Refused};

/// The roster is published five times a second; a frozen supervisor publishes none.
pub(crate) const PATIENCE: Duration = Duration::from_secs(2);

/// A robot that obeys rests within a second. The link repeats a stop five times a second, and uses the next method after a second.
const REST_PATIENCE: Duration = Duration::from_secs(5);

/// Let the robot stand, and wait until it rests.
pub(crate) fn stand(robot: &RobotName) -> Result<(), Failure> {
    ask(robot, RequestKind::Stop, "")?;
    await_rest(robot)
}

/// Wait until the link says that it stopped the robot, and the robot's encoders that it rests.
fn await_rest(robot: &RobotName) -> Result<(), Failure> {
    let bus = Bus::join(&Domain::of(robot.clone()), "operator")?;
    let mut links = bus.reader(&topics::LINK)?;
    let mut waiter = Waiter::default();
    waiter.on(bus.wakeup(&topics::LINK)?);
    let began = Instant::now();
    let mut newest = None;
    while began.elapsed() < REST_PATIENCE {
        newest = links.newest()?.or(newest);
        if newest.as_ref().is_some_and(rests) {
            return Ok(());
        }
        waiter.wait(topics::LINK.restated_every())?;
    }
    let seen = match newest {
        None => "its link publishes nothing; the robot's timed command has ended".to_owned(),
        Some(link) if link.connected == 0 => {
            "it does not answer; it is ordered to stand when it does".to_owned()
        }
        Some(link) => format!("{}: it moves", link.cause().name()),
    };
    let message = format!(
        "robot {robot} is ordered to stand and was not seen at rest within {} s: {seen}; see `firsthand status`",
        REST_PATIENCE.as_secs()
    );
    Err(Refused::new("not-at-rest", message).into())
}

/// Whether the link stops the robot for the operator, or ends the mission, and the robot rests.
fn rests(link: &LinkSample) -> bool {
    let stopped = link.cause() == Cause::OperatorStop || link.action() == Action::End;
    stopped && link.at_rest == 1
}

/// The name of a stage of the table.
pub(crate) fn known(stage: &str) -> Result<&'static str, Failure> {
    Ok(known_stage(stage)?.name)
}

pub(crate) fn known_stage(stage: &str) -> Result<&'static Stage, Refused> {
    stages::find(stage).ok_or_else(|| Refused::new("unknown-stage", stages::unknown(stage)))
}

/// Send a request to the supervisor, and wait until the roster confirms it.
pub(crate) fn ask(robot: &RobotName, kind: RequestKind, stage: &str) -> Result<(), Failure> {
    let bus = Bus::join(&Domain::of(robot.clone()), "operator")?;
    // The roster is opened first, so that the confirmation is not missed.
    let mut roster = Roster::open(&bus)?;
    let mut requests = bus.writer(&topics::REQUESTS, 1)?;
    let id = new_id();
    let request =
        RequestSample { id, stage: name(stage), kind: kind.into(), ..RequestSample::default() };
    requests.publish(0, MissionTime::default(), request)?;
    find(&mut roster, robot, |header, _| (header.last_request == id).then_some(()))
}

/// An id for a request, which no other process uses: it mixes time and process id.
pub(crate) fn new_id() -> u64 {
    monotonic_ns() ^ u64::from(std::process::id()) << 40 | 1
}

/// Send a signal to the process of `stage`, or to the supervisor. It is sent only to a process that holds the lock of its robot.
pub(crate) fn send(robot: &RobotName, stage: &str, signal: Signal) -> Result<(), Failure> {
    let domain = Domain::of(robot.clone());
    // A frozen supervisor publishes nothing.
    let (pid, lock) = if stage == "supervisor" {
        let holder = domain.supervisor();
        let holder = holder
            .map_err(|error| format!("cannot find the supervisor of robot {robot}: {error}"))?;
        (holder, domain.lock_file())
    } else {
        (pid_of(&domain, known(stage)?)?, domain.stages_lock_file())
    };
    let pid = pid.ok_or_else(|| {
        let message =
            format!("{stage} of robot {robot} has no process now; see `firsthand status`");
        Refused::new("no-process", message)
    })?;
    File::open(&lock)
        .and_then(|lock| lock_holders::signal(pid, &lock, signal))
        .map_err(|error| format!("cannot signal {stage} ({pid}): {error}"))?;
    Ok(())
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

/// The first result that `find` has for a roster.
pub(crate) fn find<T>(
    roster: &mut Roster,
    robot: &RobotName,
    find: impl Fn(&RosterHeader, &[RosterEntry]) -> Option<T>,
) -> Result<T, Failure> {
    let found = roster.find(PATIENCE, find)?;
    found.ok_or_else(|| {
        let message = format!(
            "the supervisor of robot {robot} does not answer; is it frozen? (`firsthand stage thaw supervisor`)"
        );
        Refused::new("no-answer", message).into()
    })
}
