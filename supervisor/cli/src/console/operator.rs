//! The operator's part: requests to the supervisor of a robot, signals to its processes.

use std::{
    fs::File,
    io::Read as _,
    process::{Child, Stdio},
    time::{Duration, Instant},
};

use common::{
    bus::Bus,
    clock::{MissionTime, monotonic_ns},
    domain::{Domain, RobotName},
    lock_holders, poll,
    roster::Roster,
    run::Run,
    samples::{
        Action, Cause, LinkSample, RequestKind, RequestSample, RosterEntry, RosterHeader, name,
        name_str,
    },
    stop_socket::{self, Answer, Request},
    topics::{self, AnyTopic as _},
    waiter::Waiter,
};
use rustix::process::Signal;
use supervisor::{
    process,
    stages::{self, Stage},
    stop_guard,
};

use super::{
    failure::{Failure, Refused},
    output::write_stderr,
};

/// The roster is published five times a second; a frozen supervisor publishes none.
pub(crate) const PATIENCE: Duration = Duration::from_secs(2);

/// A process that tells the supervisor has started by then, too.
const TOLD_WITHIN: Duration = Duration::from_secs(4);

/// A robot that obeys rests within a second. The link repeats a stop five times a second, and uses the next method after a second.
const REST_PATIENCE: Duration = Duration::from_secs(5);

/// A link that is scheduled answers within milliseconds.
const LINK_ANSWERS: Duration = Duration::from_millis(200);

/// Let the robot stand, and wait until it rests. The link is asked directly, without the middleware. The supervisor is told as
/// well: mission time stops, and the stop holds for its successors. Where no link answers, the robot itself is told to stand.
pub(crate) fn stand(robot: &RobotName) -> Result<(), Failure> {
    let domain = Domain::of(robot.clone());
    let link = stop_socket::Operator::connect(&domain)
        .map_err(|error| format!("cannot open a socket to the link: {error}"))?
        .filter(|link| {
            let answer = link.send(Request::Stop).and_then(|()| link.answer(LINK_ANSWERS));
            matches!(answer, Ok(Some(_)))
        });
    let run = Run::load(&domain.run_directory());
    if link.is_none() && run.is_err() {
        ask(robot, RequestKind::Stop, "")?;
        return await_rest(robot);
    }
    let supervisor = tell_supervisor(robot)?;
    let rests = match (link, run) {
        (Some(link), _) => rests_by(&link),
        // A link that answers nobody sends nothing either.
        (None, Ok(run)) => stop_guard::stand(&run, || false)?,
        (None, Err(_)) => false,
    };
    let told = told(supervisor);
    match told {
        Err(why) if rests => {
            write_stderr(&format!(
                "firsthand: the robot rests; its supervisor was not told: {why}\n"
            ));
            Ok(())
        }
        Err(why) => Err(why.into()),
        Ok(()) if rests => Ok(()),
        Ok(()) => await_rest(robot),
    }
}

/// Whether `link` says that the robot rests, in time.
fn rests_by(link: &stop_socket::Operator) -> bool {
    let began = Instant::now();
    loop {
        match link.answer(REST_PATIENCE.saturating_sub(began.elapsed())) {
            Ok(Some(Answer::AtRest)) => return true,
            Ok(Some(Answer::Heard)) => {}
            Ok(None) | Err(_) => return false,
        }
    }
}

/// Ask the supervisor for a stop, in a process of its own: the files of a damaged bus can end the process that opens them.
fn tell_supervisor(robot: &RobotName) -> Result<Child, Failure> {
    let child =
        process::firsthand(&["stop", "--through-supervisor", "--robot", &robot.to_string()])
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn();
    Ok(child
        .map_err(|error| format!("cannot start a process that tells the supervisor: {error}"))?)
}

/// Whether the process that tells the supervisor did.
fn told(mut teller: Child) -> Result<(), Refused> {
    let mut why = String::new();
    let mut said = teller.stderr.take();
    // Its end closes the pipe.
    let ended =
        said.as_ref().is_none_or(|said| poll::is_readable(said, TOLD_WITHIN).unwrap_or(true));
    if !ended {
        let _ = teller.kill();
    }
    if let Some(said) = &mut said {
        let _ = said.take(4096).read_to_string(&mut why);
    }
    match teller.wait() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) if why.is_empty() => {
            Err(Refused::new("no-answer", format!("it ended with {status}")))
        }
        _ => {
            Err(Refused::new("no-answer", why.trim().trim_start_matches("firsthand: ").to_owned()))
        }
    }
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

/// Let a stopped robot go on.
pub(crate) fn resume(robot: &RobotName) -> Result<(), Failure> {
    // A stop of which the supervisor was not told is the link's alone.
    if let Ok(Some(link)) = stop_socket::Operator::connect(&Domain::of(robot.clone())) {
        let _ = link.send(Request::Resume);
    }
    ask(robot, RequestKind::Resume, "")
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
