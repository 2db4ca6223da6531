//! Tests of the robot's stops, tapped on the wire.

use std::{
    sync::mpsc::{Receiver, Sender, channel},
    time::{Duration, Instant},
};

use crate::support::{
    PATIENCE, Run, STAGES, assert_no_restart, logged, not_run, wait_until_all_ended,
    wire::{Proxy, Robot},
};
use common::{
    process_status,
    wire::{Command, Decoder},
};
use rustix::process::Signal;

/// Duration of a command: `robot.command_limit_s`.
const LIMIT: Duration = Duration::from_millis(250);
const PERIOD: Duration = Duration::from_millis(143);

/// Motion command from the link to the robot.
#[derive(Clone, Copy, Debug)]
struct Heard {
    at: Instant,
    moving: bool,
    limit: Duration,
}

impl Heard {
    /// Returns whether this is a tick's command. A repetition has less time left.
    fn valid(&self) -> bool {
        self.moving && self.limit == LIMIT
    }
}

pub(crate) struct Tap {
    pub(crate) proxy: Proxy,
    heard: Receiver<Heard>,
}

impl Tap {
    pub(crate) fn before(robot: &Robot) -> Self {
        let (tell, heard) = channel();
        let mut decoder = Decoder::default();
        let listens = move |bytes: &[u8]| {
            decoder.push(bytes);
            listen(&mut decoder, Instant::now(), &tell);
            bytes.to_vec()
        };
        let proxy = Proxy::before(robot, Box::new(listens), Box::new(<[u8]>::to_vec));
        Self { proxy, heard }
    }

    fn next(&self) -> Heard {
        self.heard.recv_timeout(PATIENCE).unwrap()
    }

    fn next_that(&self, is_so: impl Fn(&Heard) -> bool) -> Heard {
        let began = Instant::now();
        let heard = std::iter::repeat_with(|| self.next());
        heard.take_while(|_| began.elapsed() < PATIENCE).find(is_so).unwrap()
    }

    /// Asserts that the last command is zero. All senders must have ended.
    #[track_caller]
    pub(crate) fn assert_last_is_zero(&self) {
        let last = self.heard.try_iter().last().unwrap();
        assert!(!last.moving, "{last:?}");
    }

    /// Returns the longest time without a new command after a valid one, among all commands so far.
    ///
    /// The gap ends at the next valid command, at a zero, or now. With `link_down` it also ends at
    /// the command's time limit.
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

fn listen(decoder: &mut Decoder, at: Instant, tell: &Sender<Heard>) {
    while let Some(frame) = decoder.next_frame() {
        let Ok(Command::Motion(motion)) = Command::parse(&frame) else {
            continue;
        };
        let turns = |channel| motion.targets.of(channel).is_some_and(|speed| speed != 0);
        let limit =
            motion.limit_ms.map_or(Duration::MAX, |limit| Duration::from_millis(limit.into()));
        let _ = tell.send(Heard { at, moving: turns(0) || turns(1), limit });
    }
}

fn tapped(robot: &str) -> (Robot, Tap, Run) {
    let body = Robot::on_the_course();
    let tap = Tap::before(&body);
    let run = Run::start(robot, "obstacle-course", &tap.proxy.as_robot());
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
            let longest = tap.longest_uncommanded(moving, stage == "link");
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
    // Until then it may stand briefly and go on.
    let is_silent = Instant::now() + Duration::from_secs(2);
    tap.next_that(|heard| !heard.moving && heard.at > is_silent);
    for _ in 0..10 {
        let heard = tap.next();
        assert!(!heard.moving, "{heard:?}");
    }
    run.signal(Signal::CONT);
    tap.next_that(|heard| heard.moving);
    assert!(logged(&run.directory(), "link", &["cause=\"supervisor silent\""]) > 0);
    assert_no_restart(&run.stop());
}

/// Returns whether this process and its children ignore `signal`. Under `nohup` they ignore SIGHUP.
fn ignores(signal: Signal) -> bool {
    let mask = process_status::field("self/status", "SigIgn").unwrap();
    let mask = u64::from_str_radix(&mask, 16).unwrap();
    mask >> (signal.as_raw() - 1) & 1 == 1
}

#[test]
fn a_run_that_a_signal_ends_or_kills_leaves_the_command_zero_and_no_process() {
    for signal in [Signal::INT, Signal::TERM, Signal::HUP, Signal::KILL] {
        if signal == Signal::HUP && ignores(signal) {
            not_run("a_run_that_a_signal_ends_or_kills", "nohup: no SIGHUP");
            continue;
        }
        let (_body, tap, mut run) = tapped("tap-end");
        tap.next_that(|heard| heard.moving);
        run.wait_until_under_way(0.3);
        run.signal(signal);
        if signal == Signal::KILL {
            run.reap();
            wait_until_all_ended("tap-end");
        } else {
            run.ends(0, "aborted");
        }
        tap.assert_last_is_zero();
    }
    // The files of the killed run do not hinder the next run, and are removed with it.
    Run::start("tap-end", "open-room", "").arrives();
}
