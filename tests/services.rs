//! Runs under a service manager: this test in the place of systemd.
#![allow(clippy::unwrap_used, clippy::panic)]

mod support;

use std::{
    os::{
        fd::AsFd,
        unix::{fs::MetadataExt, net::UnixDatagram},
    },
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use rustix::process::Signal;
use support::{PATIENCE, Run, assert_nothing_left, find, firsthand, signal_process};
use tempfile::TempDir;

/// What a unit would give as WatchdogSec.
const WATCHDOG: Duration = Duration::from_millis(600);

/// A place where a service says how it goes.
struct Manager {
    socket: UnixDatagram,
    directory: TempDir,
}

impl Manager {
    fn new() -> Self {
        let directory = tempfile::tempdir().unwrap();
        let socket = UnixDatagram::bind(directory.path().join("notify")).unwrap();
        socket.set_read_timeout(Some(PATIENCE)).unwrap();
        Self { socket, directory }
    }

    /// `command` as systemd would start it.
    fn adopt(&self, command: &mut Command) {
        command
            .env("NOTIFY_SOCKET", self.directory.path().join("notify"))
            .env("WATCHDOG_USEC", WATCHDOG.as_micros().to_string());
    }

    /// The lines of what is said next.
    fn hear(&self) -> Vec<String> {
        let mut message = [0; 4096];
        let length = self.socket.recv(&mut message).unwrap();
        let text = String::from_utf8(message[..length].to_vec()).unwrap();
        text.lines().map(str::to_owned).collect()
    }

    /// Everything up to the message with `line`.
    fn hear_until(&self, line: &str) -> Vec<String> {
        let began = Instant::now();
        let mut heard = Vec::new();
        loop {
            let lines = self.hear();
            let done = lines.iter().any(|said| said == line);
            heard.extend(lines);
            if done {
                return heard;
            }
            assert!(began.elapsed() < PATIENCE, "no {line} in {heard:?}");
        }
    }
}

fn mission(robot: &str, directory: &TempDir) -> Command {
    let mut command = firsthand(&["run", "open-room", "--robot", robot, "--pace", "1", "--out"]);
    command
        .arg(directory.path().join("run"))
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command
}

#[test]
fn systemd_hears_ready_a_status_the_watchdog_at_half_its_time_and_stopping() {
    let manager = Manager::new();
    let directory = support::directory_of("notify");
    let mut command = mission("notify", &directory);
    manager.adopt(&mut command);
    let mut run = command.spawn().unwrap();
    manager.hear_until("READY=1");
    // A loop that is late by a whole half would be killed; so much is left of what is allowed.
    let mut fed = Instant::now();
    for _ in 0..6 {
        manager.hear_until("WATCHDOG=1");
        assert!(fed.elapsed() < WATCHDOG, "{:?}", fed.elapsed());
        fed = Instant::now();
    }
    let heard = manager.hear_until_status();
    assert!(heard.contains("5/5 stages alive"), "{heard}");
    signal_process(run.id(), Signal::TERM);
    manager.hear_until("STOPPING=1");
    assert_eq!(run.wait().unwrap().code(), Some(0));
    assert_nothing_left("notify");
}

impl Manager {
    /// The status line of a robot that drives.
    fn hear_until_status(&self) -> String {
        let began = Instant::now();
        loop {
            let lines = self.hear();
            let mut statuses = lines.iter().filter_map(|line| line.strip_prefix("STATUS="));
            if let Some(status) = statuses.find(|status| status.contains("to go")) {
                return status.to_owned();
            }
            assert!(began.elapsed() < PATIENCE, "no status");
        }
    }
}

#[test]
fn a_frozen_supervisor_does_not_feed_the_watchdog() {
    let manager = Manager::new();
    let directory = support::directory_of("hang");
    let mut command = mission("hang", &directory);
    manager.adopt(&mut command);
    let mut run = command.spawn().unwrap();
    manager.hear_until("READY=1");
    signal_process(run.id(), Signal::STOP);
    // What was said before it froze.
    manager.socket.set_nonblocking(true).unwrap();
    let mut message = [0; 4096];
    while manager.socket.recv(&mut message).is_ok() {}
    manager.socket.set_nonblocking(false).unwrap();
    manager.socket.set_read_timeout(Some(WATCHDOG)).unwrap();
    assert!(manager.socket.recv(&mut message).is_err(), "it speaks");
    // As systemd would, after which the stages go with it and the next run finds nothing in its way.
    signal_process(run.id(), Signal::KILL);
    run.wait().unwrap();
    assert_eq!(support::run("hang", "open-room", &[]).0, Some(0));
    assert_nothing_left("hang");
}

#[test]
fn in_a_journal_a_stages_death_has_its_priority() {
    let directory = support::directory_of("journal");
    let journal = std::fs::File::create(directory.path().join("journal")).unwrap();
    let found = journal
        .as_fd()
        .try_clone_to_owned()
        .map(std::fs::File::from);
    let found = found.unwrap().metadata().unwrap();
    let mut run = mission("journal", &directory)
        .env("JOURNAL_STREAM", format!("{}:{}", found.dev(), found.ino()))
        .stderr(journal)
        .spawn()
        .unwrap();
    let status = support::wait_for_status("journal", |status| status["order"] == "driving");
    let mapper = find(&status, "mapper")["pid"].as_u64().unwrap();
    signal_process(mapper as u32, Signal::KILL);
    support::wait_for_status("journal", |status| {
        find(status, "mapper")["generation"] == 2
    });
    signal_process(run.id(), Signal::TERM);
    run.wait().unwrap();
    let text = std::fs::read_to_string(directory.path().join("journal")).unwrap();
    let death = text
        .lines()
        .find(|line| line.contains("stage ended"))
        .unwrap();
    assert!(
        death.starts_with("<4>") && death.contains("mapper"),
        "{text}"
    );
    let said: Vec<_> = text.lines().filter(|line| !line.starts_with('<')).collect();
    assert_eq!(
        said.len(),
        1,
        "only the mission's title has no priority: {said:?}"
    );
    // The same is in the run directory, and stages, whose words go to files, put no priorities there.
    let log =
        |name: &str| std::fs::read_to_string(directory.path().join("run").join(name)).unwrap();
    assert!(log("supervisor.log").contains("stage ended"));
    assert!(!log("mapper.log").contains("<6>"));
}

/// Stages that this test starts and starts again, as systemd would.
struct Units {
    robot: &'static str,
    running: Vec<(&'static str, Child)>,
    // Their words go to files there.
    directory: TempDir,
}

impl Units {
    fn start(robot: &'static str) -> Self {
        let mut units = Self {
            robot,
            running: Vec::new(),
            directory: tempfile::tempdir().unwrap(),
        };
        for stage in support::STAGES {
            units.start_one(stage);
        }
        units
    }

    fn start_one(&mut self, stage: &'static str) {
        let mut log = std::fs::File::options();
        let log = log.create(true).append(true).open(self.log(stage));
        let child = firsthand(&["stage", stage, "--robot", self.robot])
            .stderr(log.unwrap())
            .spawn()
            .unwrap();
        self.running.push((stage, child));
    }

    fn log(&self, stage: &str) -> std::path::PathBuf {
        self.directory.path().join(stage)
    }

    /// SIGKILL, and a successor when it is reaped, as with `Restart=always`.
    fn kill_and_restart(&mut self, stage: &'static str) {
        let at = self.running.iter().position(|(name, _)| *name == stage);
        let (_, mut child) = self.running.swap_remove(at.unwrap());
        signal_process(child.id(), Signal::KILL);
        child.wait().unwrap();
        self.start_one(stage);
    }

    /// Wait until all have ended of themselves, each in order.
    fn assert_all_leave(&mut self) {
        for (stage, mut child) in self.running.drain(..) {
            let code = child.wait().unwrap().code();
            let log = std::fs::read_to_string(self.directory.path().join(stage)).unwrap();
            assert_eq!(code, Some(0), "{stage}: {log}");
        }
    }
}

impl Drop for Units {
    fn drop(&mut self) {
        for (_, child) in &mut self.running {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// A supervisor that only watches, with a bus to join.
fn watching(robot: &'static str) -> (Run, Units) {
    let mut run = Run::start(robot, "obstacle-course", &["--pace", "4", "--watch-only"]);
    run.wait_until("there is a bus", |status| status["order"] == "starting");
    (run, Units::start(robot))
}

#[test]
fn stages_that_another_starts_drive_and_survive_kills_under_a_supervisor_that_only_watches() {
    let (mut run, mut units) = watching("units");
    run.wait_until_under_way(2.0);
    for stage in support::STAGES {
        units.kill_and_restart(stage);
        run.wait_until("its next life runs", |status| {
            let stage = find(status, stage);
            stage["generation"] == 2 && stage["state"] == "running"
        });
    }
    let (code, summary) = run.finish();
    assert_eq!(
        (code, &summary["outcome"]),
        (Some(0), &"reached".into()),
        "{summary}"
    );
    assert_eq!(summary["collisions"], 0, "{summary}");
    for stage in support::STAGES {
        assert_eq!(summary["restarts"][stage], 1, "{summary}");
    }
    units.assert_all_leave();
    assert_nothing_left("units");
}

#[test]
fn a_frozen_stage_of_another_is_ended_by_the_supervisor_that_only_watches() {
    let (mut run, mut units) = watching("unit-hang");
    let status = run.wait_until_under_way(1.0);
    let mapper = find(&status, "mapper")["pid"].as_u64().unwrap() as u32;
    signal_process(mapper, Signal::STOP);
    let at = units.running.iter().position(|(name, _)| *name == "mapper");
    let (_, mut frozen) = units.running.swap_remove(at.unwrap());
    assert_eq!(frozen.wait().unwrap().code(), None, "it was not signalled");
    units.start_one("mapper");
    run.wait_until("its next life runs", |status| {
        find(status, "mapper")["generation"] == 2 && find(status, "mapper")["state"] == "running"
    });
    run.signal(Signal::TERM);
    assert_eq!(run.finish().0, Some(0));
    units.assert_all_leave();
    assert_nothing_left("unit-hang");
}

#[test]
fn stages_that_another_starts_stop_the_robot_and_end_when_the_supervisor_is_killed() {
    let robot = "unit-orphan";
    let (mut run, mut units) = watching(robot);
    run.wait_until_under_way(1.0);
    run.signal(Signal::KILL);
    run.reap();
    units.assert_all_leave();
    let log = std::fs::read_to_string(units.log("x80-link")).unwrap();
    assert!(log.contains("robot told to stand"), "{log}");
    assert_eq!(support::run(robot, "open-room", &[]).0, Some(0));
    assert_nothing_left(robot);
}

#[test]
fn a_stage_without_a_place_is_refused_with_the_remedy() {
    let refused = |stage: &str, robot: &str| {
        let output = support::output(&["stage", stage, "--robot", robot]);
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8(output.stderr).unwrap()
    };
    let none = refused("mapper", "nobody");
    assert!(none.contains("--watch-only"), "{none}");

    let mut own = Run::start("own", "open-room", &["--pace", "1"]);
    own.wait_until("it drives", |status| status["order"] == "driving");
    let child = refused("mapper", "own");
    assert!(child.contains("starts its stages itself"), "{child}");
    own.signal(Signal::TERM);
    own.finish();

    let (mut run, units) = watching("taken");
    run.wait_until_under_way(0.5);
    let second = refused("mapper", "taken");
    assert!(second.contains("lives already"), "{second}");
    run.signal(Signal::TERM);
    run.finish();
    drop(units);
}
