//! Operator requests to a robot, from any process.
//!
//! Each function returns once link or supervisor confirms the request, or with the refusal.

use std::{
    env, fs,
    io::{self, Read as _},
    os::unix::process::CommandExt as _,
    path::{Path, PathBuf},
    process::{Child, Stdio},
    thread,
    time::{Duration, Instant},
};

use common::{
    bus::BusError,
    clock::{MissionTime, monotonic_ns},
    domain::{Domain, RobotName},
    poll,
    process_status::processor_time,
    roster::{self, Roster},
    run::Run,
    samples::{
        Action, Cause, LinkSample, MOST_TARGETS, RequestAnswer, RequestKind, RequestSample, Rest,
        RosterEntry, RosterHeader, TargetPoint, name,
    },
    stop_socket::{Answer, Identity, Operator, OwedStop, Request, StopMark},
    topics,
    waiter::Waiter,
};
use glam::DVec2;
use link::stop_guard;
use processes::{executable, process};
use thiserror::Error;

use crate::{Refused, refuse};

/// Timeout for a supervisor, whose roster comes at 5 Hz. With 25 busy processes per core, one took
/// over 4 s.
pub const PATIENCE: Duration = Duration::from_secs(10);
/// Timeout for a supervisor that runs now and then, on a starved machine.
const STARVED_PATIENCE: Duration = Duration::from_secs(60);
/// Interval for repeating a request that a starting run refused.
const AGAIN_AFTER: Duration = Duration::from_millis(100);

#[derive(Debug, Error)]
pub enum OperatorError {
    #[error(transparent)]
    Bus(#[from] BusError),
    #[error(transparent)]
    Refused(#[from] Refused),
    #[error("cannot {0}: {1}")]
    System(&'static str, io::Error),
}

type Result<T = (), E = OperatorError> = std::result::Result<T, E>;

fn system(action: &'static str) -> impl Fn(io::Error) -> OperatorError + Copy {
    move |error| OperatorError::System(action, error)
}

const fn code(answer: RequestAnswer) -> &'static str {
    match answer {
        RequestAnswer::Taken | RequestAnswer::Unknown => "unknown-request",
        RequestAnswer::NotRunning => "not-driving",
        RequestAnswer::Stopped => "robot-stopped",
        RequestAnswer::Malformed => "no-target",
        RequestAnswer::TooMany => "too-many-targets",
        RequestAnswer::Outside => "target-outside",
        RequestAnswer::InHazard => "target-in-hazard",
        RequestAnswer::NoHeading => "no-heading",
        RequestAnswer::FixedTarget => "fixed-target",
        RequestAnswer::Moves => "robot-moves",
        RequestAnswer::NoZone => "no-zone",
        RequestAnswer::ZoneHere => "zone-here",
        RequestAnswer::NotInZone => "not-in-zone",
        RequestAnswer::NotStaying => "not-staying",
        RequestAnswer::TooNear => "too-near",
        RequestAnswer::NotFollowing => "not-following",
    }
}

const TOLD_WITHIN: Duration = PATIENCE.saturating_add(Duration::from_secs(2));

/// Timeout for a stop; the link changes its method after 1 s.
const REST_PATIENCE: Duration = Duration::from_secs(5);

/// Timeout for a link, which answers within milliseconds when scheduled.
const LINK_ANSWERS: Duration = Duration::from_millis(200);

const GUARD_STARTS: Duration = Duration::from_millis(20);

/// Stops the robot and waits until it rests.
///
/// The request reaches the link without the middleware. The supervisor hears it too, so that its
/// successors keep the stop. If no link answers, a stop guard stops the robot. Returns the reason why
/// the supervisor does not know of the stop, which holds anyway.
pub fn stand(robot: &RobotName) -> Result<Option<String>> {
    let asked_ns = monotonic_ns();
    let domain = robot.domain();
    refuse_mirror(&domain)?;
    domain.made_again(domain.stop_socket());
    let link = told_link(&domain)?;
    if link.is_none() && Run::load(&domain.run_directory()).is_err() {
        if !owes_stop(robot) {
            request_stop(robot, asked_ns)?;
            return await_rest(robot, stopped_for_good).map(|()| None);
        }
        if comes_to_rest(&domain, None)? {
            return Ok(None);
        }
        let seen = sees(robot).map_or("its state is unknown".into(), |(seen, _)| seen);
        return Err(not_at_rest(robot, &seen));
    }
    let supervisor = tell_supervisor(robot, asked_ns)?;
    let rests = comes_to_rest(&domain, link)?;
    let told = told(supervisor);
    if rests {
        return Ok(told.err().map(|why| why.to_string()));
    }
    match sees(robot) {
        Some((seen, _)) => Err(not_at_rest(robot, &seen)),
        None => told.and_then(|()| await_rest(robot, stopped_for_good)).map(|()| None),
    }
}

/// Tells the link to stop the robot, without waiting. [`stand`] does the rest.
pub fn stop_at_once(robot: &RobotName) {
    if let Ok(Some(link)) = Operator::connect(&robot.domain().stop_socket()) {
        let _ = link.send(Request::Stop);
    }
}

/// Returns whether the robot may move although no link drives it.
pub fn owes_stop(robot: &RobotName) -> bool {
    OwedStop::of(robot.domain()).is_set()
}

/// Connects to the robot's stop guard; starts one if none answers.
fn guard(domain: &Domain) -> Result<Operator> {
    let unreachable = system("reach the stop guard");
    let told = || {
        let guard = Operator::connect(&domain.guard_socket()).map_err(unreachable)?;
        guard.iter().try_for_each(|guard| guard.send(Request::Stop)).map_err(unreachable)?;
        Ok::<_, OperatorError>(guard)
    };
    if let Some(guard) = told()? {
        return Ok(guard);
    }
    let directory = fs::canonicalize(domain.owed_stop())
        .map_err(system("find the run of the robot that may move"))?;
    let link = Identity::now(&domain.stop_socket());
    stop_guard::spawn(robot_executable(), &directory, &link, Stdio::null()).map_err(unreachable)?;
    let began = Instant::now();
    loop {
        match told()? {
            Some(guard) => return Ok(guard),
            None if began.elapsed() > PATIENCE => {
                return refuse(
                    "no-answer",
                    "the stop guard does not start; see link.log of the run",
                );
            }
            None => thread::park_timeout(GUARD_STARTS),
        }
    }
}

/// Returns the stop guard's observation and its seconds of silence.
pub fn sees(robot: &RobotName) -> Option<(String, u8)> {
    let guard = Operator::connect(&robot.domain().guard_socket()).ok().flatten()?;
    guard.send(Request::Look).ok()?;
    loop {
        match guard.answer(PATIENCE).ok()?? {
            Answer::Heard => {}
            Answer::AtRest | Answer::Sees(Rest::AtRest, _) => return Some(("it rests".into(), 0)),
            Answer::Sees(Rest::Moving, _) => return Some(("it moves".into(), 0)),
            Answer::Sees(Rest::Unknown, silent_s) => {
                return Some((format!("silent for {silent_s} s"), silent_s));
            }
        }
    }
}

/// Ends the stop guard's orders after a person saw the robot at rest or off.
///
/// # Errors
/// Fails while a link runs.
pub fn sign_off(robot: &RobotName) -> Result {
    let domain = robot.domain();
    let failed = system("sign the robot off");
    if domain.is_supervised() {
        return refuse("running", format!("robot {robot} has a run; end it first"));
    }
    if let Some(guard) = Operator::connect(&domain.guard_socket()).map_err(failed)? {
        return guard.send(Request::SignOff).map_err(failed);
    }
    OwedStop::of(domain.clone()).set(false, Path::new("")).map_err(failed)?;
    // A killed guard leaves these files.
    let _ = fs::remove_file(domain.guard_socket());
    let _ = fs::remove_dir(domain.directory());
    Ok(())
}

/// Tells the link to stop the robot. Returns `None` if no link answers, which then sends no
/// commands either.
fn told_link(domain: &Domain) -> Result<Option<Operator>> {
    Ok(Operator::connect(&domain.stop_socket())
        .map_err(system("open a socket to the link"))?
        .filter(|link| {
            let answer = link.send(Request::Stop).and_then(|()| link.answer(LINK_ANSWERS));
            matches!(answer, Ok(Some(_)))
        }))
}

/// Waits until the robot rests, as `link` sees it, or as whoever follows a link that dies: the next
/// link or the stop guard.
fn comes_to_rest(domain: &Domain, mut link: Option<Operator>) -> Result<bool> {
    let began = Instant::now();
    // A guard that dies again and again keeps nobody waiting.
    while began.elapsed() < PATIENCE {
        let seen_by = match link {
            Some(link) => link,
            None if owes_stop(&domain.robot) => guard(domain)?,
            // The robot was seen at rest, without a later order to move.
            None => return Ok(true),
        };
        if let Some(rests) = rests_by(&seen_by) {
            return Ok(rests);
        }
        link = told_link(domain)?;
    }
    Ok(false)
}

/// Returns whether the robot rests; `None` if the process that sees it dies first.
fn rests_by(seen_by: &Operator) -> Option<bool> {
    const { assert!(LINK_ANSWERS.as_millis() < REST_PATIENCE.as_millis()) };
    const { assert!(REST_PATIENCE.as_millis() < PATIENCE.as_millis()) };
    let began = Instant::now();
    while began.elapsed() < REST_PATIENCE {
        match seen_by.answer(LINK_ANSWERS) {
            Ok(Some(Answer::AtRest)) => return Some(true),
            Ok(None) if seen_by.is_heard() => {}
            Ok(None) | Err(_) => return None,
            Ok(Some(Answer::Heard | Answer::Sees(..))) => {}
        }
    }
    Some(false)
}

/// Returns this program, even if its file was replaced, or the one beside a viewer.
fn robot_executable() -> PathBuf {
    let own = env::current_exe().unwrap_or_default();
    let is_viewer =
        own.file_name().is_some_and(|name| name.to_string_lossy().starts_with("firsthand-"));
    is_viewer
        .then(|| executable::find("firsthand".as_ref()).ok())
        .flatten()
        .unwrap_or_else(|| PathBuf::from("/proc/self/exe"))
}

/// Tells the supervisor of a stop in a separate process, because files of a damaged bus can kill a
/// process.
fn tell_supervisor(robot: &RobotName, asked_ns: u64) -> Result<Child> {
    let (robot, asked) = (robot.to_string(), asked_ns.to_string());
    process::child(robot_executable())
        .arg0("firsthand")
        .args(["stop", "--robot", &robot, "--through-supervisor", &asked])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(system("start a process that tells the supervisor"))
}

fn told(mut teller: Child) -> Result {
    let mut why = String::new();
    let mut said = teller.stderr.take();
    // The pipe closes when the process ends.
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
        Ok(status) if why.is_empty() => refuse("no-answer", format!("it ended with {status}")),
        _ => refuse("no-answer", why.trim().trim_start_matches("firsthand: ")),
    }
}

fn await_rest(robot: &RobotName, rests: impl Fn(&LinkSample) -> bool) -> Result {
    let bus = roster::join(&robot.domain(), "operator")?;
    let mut links = bus.reader(&topics::LINK)?;
    let mut waiter = Waiter::default();
    waiter.on(bus.wakeup(&topics::LINK)?);
    let began = Instant::now();
    let mut newest = None;
    while began.elapsed() < REST_PATIENCE {
        newest = links.newest()?.or(newest);
        if newest.as_ref().is_some_and(&rests) {
            return Ok(());
        }
        waiter.wait(topics::LINK.spec().restated_every())?;
    }
    let seen = match newest {
        None => "its link publishes nothing; the robot's timed command has expired".to_owned(),
        Some(link) if link.connected == 0 => {
            "it does not answer; it receives the stop order as soon as it does".to_owned()
        }
        Some(link) if link.at_rest() == Rest::Moving => {
            format!("{}: it moves", link.cause().name())
        }
        Some(_) => "whether it rests is unknown: no usable motor frames arrive".to_owned(),
    };
    Err(not_at_rest(robot, &seen))
}

fn not_at_rest(robot: &RobotName, seen: &str) -> OperatorError {
    let message = format!(
        "robot {robot} has the order to stop but was not seen at rest within {} s: {seen}; see `firsthand status`",
        REST_PATIENCE.as_secs()
    );
    Refused::new("not-at-rest", message).into()
}

/// Returns whether the robot rests, stopped for the operator or the mission's end.
fn stopped_for_good(link: &LinkSample) -> bool {
    let stopped = link.cause() == Cause::OperatorStop || link.action() == Action::End;
    stopped && link.at_rest == 1
}

pub fn resume(robot: &RobotName) -> Result {
    let domain = robot.domain();
    refuse_mirror(&domain)?;
    domain.made_again(domain.stop_socket());
    // Only this request ends the link's own stop. Without a link, the mark alone holds it.
    let _ = match Operator::connect(&domain.stop_socket()) {
        Ok(Some(link)) => link.send(Request::Resume),
        _ => StopMark::of(&domain.run_directory()).set(false),
    };
    ask(robot, request(RequestKind::Resume))
}

/// Tells the supervisor of a stop asked at `asked_ns` of the monotonic clock. A later resume ends
/// it.
pub fn request_stop(robot: &RobotName, asked_ns: u64) -> Result {
    ask(robot, RequestSample { asked_ns, ..request(RequestKind::Stop) })
}

pub fn restart(robot: &RobotName, stage: &str) -> Result {
    ask(robot, RequestSample { stage: name(stage), ..request(RequestKind::Restart) })
}

/// Sends the robot to `points` in turn: now, or after its present targets if `appends`.
pub fn send_to(robot: &RobotName, points: &[TargetPoint], appends: bool) -> Result {
    let kind = if appends { RequestKind::Append } else { RequestKind::Goto };
    ask_with(robot, request(kind), points)
}

fn ask_with(robot: &RobotName, mut request: RequestSample, points: &[TargetPoint]) -> Result {
    if points.len() > MOST_TARGETS {
        return Err(refused(robot, RequestAnswer::TooMany));
    }
    const { assert!(MOST_TARGETS <= u8::MAX as usize) };
    request.target_count = points.len() as u8;
    request.targets[..points.len()].copy_from_slice(points);
    ask(robot, request)
}

/// Drives for 0.3 s. `stick` points ahead and to the left, in shares of full speed.
pub fn drive_by_hand(robot: &RobotName, stick: DVec2) -> Result {
    ask_with(robot, request(RequestKind::Hand), &[TargetPoint::at(stick)])
}

/// `distance_m` 0 is the robot's default.
pub fn follow(robot: &RobotName, distance_m: f64) -> Result {
    ask(robot, RequestSample { deviations: [distance_m, 0.0], ..request(RequestKind::Follow) })
}

/// Returns when the robot rests.
pub fn end_follow(robot: &RobotName) -> Result {
    ask(robot, request(RequestKind::EndFollow))?;
    await_rest(robot, |link| link.stopped() && link.at_rest == 1)
}

/// Adds the keep-out zone with these corners, or removes the zones that contain a point.
pub fn change_zones(robot: &RobotName, points: &[TargetPoint], removes: bool) -> Result {
    let kind = if removes { RequestKind::RemoveZone } else { RequestKind::AddZone };
    ask_with(robot, request(kind), points)
}

pub fn send_back(robot: &RobotName) -> Result {
    let start =
        Run::load(&robot.domain().run_directory()).map_or(DVec2::ZERO, |run| run.mission.start.at);
    send_to(robot, &[TargetPoint::at(start)], false)
}

/// Sets the pose of the standing robot, with standard deviations in metres and radians.
pub fn place(robot: &RobotName, point: TargetPoint, deviations: [f64; 2]) -> Result {
    ask_with(robot, RequestSample { deviations, ..request(RequestKind::Place) }, &[point])
}

fn request(kind: RequestKind) -> RequestSample {
    RequestSample { kind: kind.into(), asked_ns: monotonic_ns(), ..RequestSample::default() }
}

fn refused(robot: &RobotName, answer: RequestAnswer) -> OperatorError {
    Refused::new(
        code(answer),
        format!("the supervisor of robot {robot} refuses: {}", answer.text()),
    )
    .into()
}

/// # Errors
/// Fails if `domain` is a mirror; the order belongs on the robot's machine.
pub fn refuse_mirror(domain: &Domain) -> Result {
    let Some(at) = domain.mirrors() else { return Ok(()) };
    refuse(
        "mirror",
        format!(
            "this is a mirror of robot {} at {at}, which accepts no orders; give them on its machine",
            domain.robot
        ),
    )
}

fn ask(robot: &RobotName, request: RequestSample) -> Result {
    let domain = robot.domain();
    refuse_mirror(&domain)?;
    let bus = roster::join(&domain, "operator")?;
    // The roster is opened first, so that the answer is not missed.
    let mut roster = Roster::open(&bus)?;
    let mut requests = bus.writer(&topics::REQUESTS, 1)?;
    let goes =
        matches!(request.kind(), RequestKind::Goto | RequestKind::Append | RequestKind::Follow);
    if goes {
        // A starting supervisor does not read yet. Hand requests are too frequent to wait for a
        // roster.
        roster.find(PATIENCE, |_, _| Some(()))?;
    }
    let began = Instant::now();
    loop {
        let id = new_id();
        requests.publish(0, MissionTime::default(), RequestSample { id, ..request })?;
        let answer = find(&mut roster, robot, |header, _| {
            (header.last_request == id).then(|| header.answer())
        })?;
        match answer {
            RequestAnswer::Taken => return Ok(()),
            // A starting run, or a supervisor that waits for a whole map.
            RequestAnswer::NotRunning if goes && began.elapsed() < PATIENCE => {
                roster.find(AGAIN_AFTER, |_, _| None::<()>)?;
            }
            answer => return Err(refused(robot, answer)),
        }
    }
}

pub fn new_id() -> u64 {
    monotonic_ns() ^ u64::from(std::process::id()) << 40 | 1
}

pub fn find<T>(
    roster: &mut Roster,
    robot: &RobotName,
    find: impl Fn(&RosterHeader, &[RosterEntry]) -> Option<T>,
) -> Result<T> {
    let (began, domain) = (Instant::now(), robot.domain());
    let ran = || processor_time(domain.supervisor().ok()??);
    loop {
        let before = ran();
        if let Some(found) = roster.find(PATIENCE, &find)? {
            return Ok(found);
        }
        if ran() <= before || began.elapsed() >= STARVED_PATIENCE {
            return refuse(
                "no-answer",
                format!(
                    "the supervisor of robot {robot} does not answer; is it frozen? (`firsthand stage thaw supervisor`)"
                ),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use common::stop_socket::StopSocket;

    use super::*;

    #[test]
    fn a_link_that_dies_after_it_heard_the_stop_leaves_the_answer_to_who_follows_it() {
        let domain = Domain::of(format!("dies-{}", std::process::id()).parse().unwrap());
        let link = StopSocket::bind(domain.stop_socket()).unwrap();
        let told = Operator::connect(&domain.stop_socket()).unwrap().unwrap();
        drop(link);
        assert!(comes_to_rest(&domain, Some(told)).unwrap());
        fs::remove_dir_all(domain.directory()).unwrap();
    }
}
