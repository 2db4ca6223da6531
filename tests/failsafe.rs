//! What stops the robot, seen on the wire: every datagram between link and robot passes through this test.

use std::{
    io::{BufRead as _, BufReader, ErrorKind},
    net::{SocketAddr, UdpSocket},
    process::{Child, Stdio},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
        mpsc::{Receiver, Sender, channel},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use crate::support::{
    self, PATIENCE, Run, STAGES, assert_ended, assert_nothing_left, assert_reached, firsthand,
    operate,
};
use common::wire::{Command, Decoder};
use rustix::process::Signal;
use serde_json::Value;

/// How long a command moves the robot: `robot.command_limit_s`.
const LIMIT: Duration = Duration::from_millis(250);
/// From tick to tick at 7 Hz.
const PERIOD: Duration = Duration::from_millis(143);

/// A simulated robot on its own.
pub(crate) struct Robot {
    process: Child,
    pub(crate) listening: String,
}

impl Robot {
    pub(crate) fn start() -> Self {
        let mut process = firsthand(&["sim", "obstacle-course", "--ground-truth"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut output = BufReader::new(process.stdout.take().unwrap());
        let mut header = String::new();
        output.read_line(&mut header).unwrap();
        let header: Value = serde_json::from_str(&header).unwrap();
        // It waits for a reader that is slow.
        std::thread::spawn(move || std::io::copy(&mut output, &mut std::io::sink()));
        Self {
            process,
            listening: header["listening"].as_str().unwrap().to_owned(),
        }
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A motion command that the link has sent to the robot.
#[derive(Clone, Copy, Debug)]
struct Heard {
    at: Instant,
    moving: bool,
    limit: Duration,
}

impl Heard {
    /// Whether it is the command of a tick: a repetition has less time left.
    fn valid(&self) -> bool {
        self.moving && self.limit == LIMIT
    }
}

/// Stands between link and robot.
pub(crate) struct Tap {
    pub(crate) address: SocketAddr,
    heard: Receiver<Heard>,
    over: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Tap {
    pub(crate) fn before(robot: &Robot) -> Self {
        let host = UdpSocket::bind("127.0.0.1:0").unwrap();
        let wire = UdpSocket::bind("127.0.0.1:0").unwrap();
        wire.connect(&robot.listening).unwrap();
        let address = host.local_addr().unwrap();
        let over = Arc::new(AtomicBool::new(false));
        let peer = Arc::new(Mutex::new(None));
        let (tell, heard) = channel();
        let (host_too, wire_too) = (host.try_clone().unwrap(), wire.try_clone().unwrap());
        let (peer_too, over_too) = (Arc::clone(&peer), Arc::clone(&over));
        let out = std::thread::spawn(move || {
            let mut decoder = Decoder::default();
            pass(&host, &over, |bytes, from| {
                let at = Instant::now();
                *peer.lock().unwrap() = Some(from);
                let _ = wire_too.send(bytes);
                decoder.push(bytes);
                listen(&mut decoder, at, &tell);
            });
        });
        let back = {
            let over = Arc::clone(&over_too);
            std::thread::spawn(move || {
                pass(&wire, &over, |bytes, _| {
                    if let Some(peer) = *peer_too.lock().unwrap() {
                        let _ = host_too.send_to(bytes, peer);
                    }
                });
            })
        };
        Self {
            address,
            heard,
            over: over_too,
            threads: vec![out, back],
        }
    }

    fn next(&self) -> Heard {
        self.heard.recv_timeout(PATIENCE).unwrap()
    }

    /// Wait for a command that is so.
    fn next_that(&self, is_so: impl Fn(&Heard) -> bool) -> Heard {
        let began = Instant::now();
        loop {
            let heard = self.next();
            if is_so(&heard) {
                return heard;
            }
            assert!(began.elapsed() < PATIENCE, "no such command");
        }
    }

    /// Once nobody sends any more: the last command that was sent does not move the robot.
    #[track_caller]
    pub(crate) fn assert_last_is_zero(&self) {
        let last = self.heard.try_iter().last().unwrap();
        assert!(!last.moving, "{last:?}");
    }

    /// The longest that the robot was left with a valid command, among all that was heard by now: until the next
    /// valid one or a zero, or until now; if the link was down, also until the end of the time that commands had.
    fn longest_uncommanded(&self, first: Heard, link_down: bool) -> Duration {
        let mut longest = Duration::ZERO;
        let (mut valid, mut ends) = (Some(first.at), first.at + first.limit);
        let mut left_until = |since: Instant, end: Instant, ends: Instant| {
            let end = if link_down { end.min(ends) } else { end };
            longest = longest.max(end.saturating_duration_since(since));
        };
        for heard in self.heard.try_iter() {
            if let Some(since) = valid
                && (heard.valid() || !heard.moving)
            {
                left_until(since, heard.at, ends);
                valid = None;
            }
            if heard.valid() {
                valid = Some(heard.at);
            }
            if heard.moving {
                ends = heard.at + heard.limit;
            }
        }
        if let Some(since) = valid {
            left_until(since, Instant::now(), ends);
        }
        longest
    }
}

/// Whatever comes on `socket`, until all is over.
pub(crate) fn pass(socket: &UdpSocket, over: &AtomicBool, mut take: impl FnMut(&[u8], SocketAddr)) {
    socket
        .set_read_timeout(Some(Duration::from_millis(50)))
        .unwrap();
    let mut buffer = [0; 2048];
    while !over.load(Ordering::Relaxed) {
        match socket.recv_from(&mut buffer) {
            Ok((length, from)) => take(&buffer[..length], from),
            // Nothing, or the other end is gone for now.
            Err(error) => assert!(
                matches!(
                    error.kind(),
                    ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::ConnectionRefused
                ),
                "{error}"
            ),
        }
    }
}

fn listen(decoder: &mut Decoder, at: Instant, tell: &Sender<Heard>) {
    while let Some(frame) = decoder.next_frame() {
        let Ok(Command::Motion(motion)) = Command::parse(&frame) else {
            continue;
        };
        let turns = |channel| motion.targets.of(channel).is_some_and(|speed| speed != 0);
        let limit = motion
            .limit_ms
            .map_or(Duration::MAX, |limit| Duration::from_millis(limit.into()));
        let _ = tell.send(Heard {
            at,
            moving: turns(0) || turns(1),
            limit,
        });
    }
}

impl Drop for Tap {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

/// A run of the default mission whose every command is heard here.
fn tapped(robot: &str) -> (Robot, Tap, Run) {
    let body = Robot::start();
    let tap = Tap::before(&body);
    let address = format!("robot.address=\"{}\"", tap.address);
    let run = Run::start(robot, "obstacle-course", &["--set", &address]);
    (body, tap, run)
}

#[test]
fn whatever_is_killed_or_frozen_the_wheels_have_zero_within_250_ms_and_a_period_of_a_valid_command()
{
    let (_body, tap, mut run) = tapped("tap-kill");
    for signal in [Signal::KILL, Signal::STOP] {
        for stage in STAGES {
            let moving = tap.next_that(Heard::valid);
            run.kill_and_await_successor(stage, signal);
            let longest = tap.longest_uncommanded(moving, stage == "x80-link");
            println!("{stage} {signal:?}: at most {} ms", longest.as_millis());
            assert!(longest <= LIMIT + PERIOD, "{stage} {signal:?}: {longest:?}");
        }
    }
    run.stop();
}

#[test]
fn a_frozen_supervisor_leads_to_a_robot_at_rest_and_a_thawed_one_lets_it_go_on() {
    let (_body, tap, mut run) = tapped("tap-watch");
    run.wait_until_under_way(0.5);
    tap.next_that(|heard| heard.moving);
    run.signal(Signal::STOP);
    let froze = Instant::now();
    let at_rest = tap.next_that(|heard| !heard.moving && heard.at > froze);
    println!(
        "at rest {} ms after the freeze",
        (at_rest.at - froze).as_millis()
    );
    for _ in 0..10 {
        let heard = tap.next();
        assert!(!heard.moving, "{heard:?}");
    }
    run.signal(Signal::CONT);
    tap.next_that(|heard| heard.moving);
    assert!(run.link_logged(&["cause=\"supervisor silent\""]));
    let summary = run.stop();
    for stage in STAGES {
        assert_eq!(summary["restarts"][stage], 0, "{summary}");
    }
}

/// Whether this process ignores `signal`, and so do the processes that it starts: under `nohup` they ignore SIGHUP.
fn ignores(signal: Signal) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = u64::from_str_radix(mask.unwrap().trim(), 16).unwrap();
    mask >> (signal.as_raw() - 1) & 1 == 1
}

#[test]
fn ctrl_c_sigterm_and_a_closed_terminal_end_a_run_in_order_and_its_last_command_is_zero() {
    for signal in [Signal::INT, Signal::TERM, Signal::HUP] {
        if ignores(signal) {
            support::not_run("ctrl_c_sigterm_and_a_closed_terminal", "nohup: no SIGHUP");
            continue;
        }
        let (_body, tap, mut run) = tapped("tap-end");
        tap.next_that(|heard| heard.moving);
        run.wait_until_under_way(0.3);
        run.signal(signal);
        let (code, summary) = run.finish();
        assert_ended(code, &summary, 0, "aborted");
        tap.assert_last_is_zero();
        assert_nothing_left("tap-end");
    }
}

#[test]
fn stages_end_with_their_supervisor_that_is_killed_and_the_last_command_is_zero() {
    let (_body, tap, mut run) = tapped("tap-orphan");
    tap.next_that(|heard| heard.moving);
    run.kill();
    support::wait_until_all_ended("tap-orphan");
    tap.assert_last_is_zero();
    // The files that it left do not hinder the next run, and are removed with it.
    Run::start("tap-orphan", "open-room", &[]).arrives();
}

#[test]
fn an_operators_stop_is_named_by_the_link() {
    let mut run = Run::start("named", "obstacle-course", &["--pace", "4"]);
    run.wait_until_under_way(0.5);
    operate("named", &["stop"]);
    run.wait_until("the link says why", |status| {
        status["link"]["cause"] == "stopped by an operator" && status["link"]["robot"] == "stands"
    });
    operate("named", &["resume"]);
    run.wait_until("the robot goes on", |status| {
        status["link"]["cause"].is_null() && status["link"]["robot"] == "goes"
    });
    run.stop();
}

#[test]
fn on_a_low_battery_the_mission_takes_longer_and_arrives_on_an_empty_one_it_ends_with_the_reason() {
    let with = |volts: &str| {
        let start = format!("simulation.battery.start_v={volts}");
        support::run("charge", "open-room", &["--set", &start])
    };
    let time = |summary: &Value| summary["mission_time_s"].as_f64().unwrap();
    let (_, full) = with("7.8");
    let (code, low) = with("6.5");
    assert_reached(code, &low);
    assert!(time(&low) > 1.5 * time(&full), "{low} against {full}");
    let (code, empty) = with("5.9");
    assert_ended(code, &empty, 6, "aborted");
    assert_eq!(empty["cause"], "battery empty", "{empty}");
    assert!((1.9..3.0).contains(&time(&empty)), "{empty}");
    assert_nothing_left("charge");
}
