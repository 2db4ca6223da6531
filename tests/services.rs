//! Runs under a service manager: this test in the place of systemd.

use std::{
    os::{
        fd::AsFd,
        unix::{fs::MetadataExt, net::UnixDatagram},
    },
    path::Path,
    process::{Command, Stdio},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use crate::support::{self, PATIENCE, Run, assert_nothing_left, find, firsthand, signal_process};
use rustix::process::Signal;
use tempfile::TempDir;

/// What a unit would give as WatchdogSec.
const WATCHDOG: Duration = Duration::from_secs(2);

/// The socket where a service reports its state.
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
    for _ in 0..3 {
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
        .find(|line| line.contains("stage died"))
        .unwrap();
    assert!(
        death.starts_with("<4>") && death.contains("mapper"),
        "{text}"
    );
    let mut said = text.lines().filter(|line| !line.starts_with('<'));
    assert!(
        said.all(|line| line.starts_with("mission ")),
        "only the mission's title has no priority: {text}"
    );
    // The same is in the run directory, and stages, which log to files, put no priorities there.
    let log =
        |name: &str| std::fs::read_to_string(directory.path().join("run").join(name)).unwrap();
    assert!(log("supervisor.log").contains("stage died"));
    assert!(!log("mapper.log").contains("<6>"));
}

/// Stages that this test starts and starts again, as systemd would with `Restart=always`.
struct Units {
    keepers: Vec<(&'static str, JoinHandle<Option<i32>>)>,
    over: Arc<AtomicBool>,
    // They log to files there.
    directory: TempDir,
}

impl Units {
    fn start(robot: &'static str) -> Self {
        let over = Arc::new(AtomicBool::new(false));
        let directory = tempfile::tempdir().unwrap();
        let keep = |stage| {
            let (over, log) = (Arc::clone(&over), directory.path().join(stage));
            let keeper = thread::spawn(move || keep_up(robot, stage, &log, &over));
            (stage, keeper)
        };
        Self {
            keepers: support::STAGES.map(keep).into(),
            over,
            directory,
        }
    }

    fn log(&self, stage: &str) -> String {
        std::fs::read_to_string(self.directory.path().join(stage)).unwrap()
    }

    /// Wait until all have ended of themselves, each in order.
    fn assert_all_leave(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        for (stage, keeper) in std::mem::take(&mut self.keepers) {
            let code = keeper.join().unwrap();
            assert_eq!(code, Some(0), "{stage}: {}", self.log(stage));
        }
    }
}

/// One process of a stage after another, until one ends in order or all is over. Returns how the last one ended.
fn keep_up(robot: &str, stage: &str, log: &Path, over: &AtomicBool) -> Option<i32> {
    loop {
        let mut append = std::fs::File::options();
        let log = append.create(true).append(true).open(log).unwrap();
        let mut command = firsthand(&["stage", stage, "--robot", robot]);
        let code = command.stderr(log).status().unwrap().code();
        if code == Some(0) || over.load(Ordering::Relaxed) {
            return code;
        }
    }
}

impl Drop for Units {
    /// The stages end with their supervisor; then they are let go.
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
    }
}

/// A supervisor that only watches, with a bus to join.
fn watching(robot: &'static str) -> (Run, Units) {
    let mut run = Run::start(robot, "obstacle-course", &["--pace", "4", "--watch-only"]);
    run.wait_until("there is a bus", |status| status["order"] == "starting");
    (run, Units::start(robot))
}

#[test]
fn external_stages_drive_and_survive_kills_under_a_supervisor_that_only_watches() {
    let (mut run, mut units) = watching("units");
    run.wait_until_under_way(2.0);
    for stage in support::STAGES {
        run.kill_and_await_successor(stage, Signal::KILL);
    }
    let (code, summary) = run.finish();
    assert_eq!(
        (code, &summary["outcome"]),
        (Some(0), &"reached".into()),
        "{summary}"
    );
    assert_eq!(summary["collisions"], 0, "{summary}");
    for stage in support::STAGES {
        assert!(summary["restarts"][stage].as_u64() >= Some(1), "{summary}");
    }
    units.assert_all_leave();
    assert_nothing_left("units");
}

#[test]
fn a_frozen_external_stage_is_ended_by_the_supervisor_that_only_watches() {
    let (mut run, mut units) = watching("unit-hang");
    run.wait_until_under_way(1.0);
    run.kill_and_await_successor("mapper", Signal::STOP);
    run.signal(Signal::TERM);
    assert_eq!(run.finish().0, Some(0));
    units.assert_all_leave();
    assert_nothing_left("unit-hang");
}

#[test]
fn external_stages_that_systemd_stops_before_their_supervisor_are_no_deaths() {
    let (mut run, mut units) = watching("unit-order");
    run.wait_until_under_way(1.0);
    let status = run.kill_and_await_successor("planner", Signal::KILL);
    for stage in support::STAGES.iter().rev() {
        signal_process(support::pid(&status, stage), Signal::TERM);
    }
    run.wait_until("all have ended", |status| {
        let stages = status["stages"].as_array().unwrap();
        stages.iter().all(|stage| stage["state"] == "down")
    });
    let deaths = run.records("deaths.jsonl");
    let stages: Vec<_> = deaths.iter().map(|death| &death["stage"]).collect();
    assert_eq!(stages, ["planner"], "{deaths:?}");
    run.signal(Signal::TERM);
    assert_eq!(run.finish().0, Some(0));
    units.assert_all_leave();
    assert_nothing_left("unit-order");
}

#[test]
fn external_stages_stop_the_robot_and_end_when_the_supervisor_is_killed() {
    let robot = "unit-orphan";
    let (mut run, mut units) = watching(robot);
    run.wait_until_under_way(1.0);
    run.signal(Signal::KILL);
    run.reap();
    units.assert_all_leave();
    let log = units.log("x80-link");
    assert!(log.contains("stop sent to the robot"), "{log}");
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
    assert!(second.contains("runs already"), "{second}");
    run.signal(Signal::TERM);
    run.finish();
    drop(units);
}

/// A service with `--resume-last`, killed when its robot drives; what starts it again.
fn killed_service(robot: &'static str) -> (TempDir, impl Fn() -> Command) {
    let directory = support::directory_of(robot);
    let runs = directory.path().to_path_buf();
    let service = move || {
        let mut command = firsthand(&["run", "open-room", "--robot", robot, "--json"]);
        command.arg("--resume-last").arg("--runs").arg(&runs);
        command
    };
    let mut cut = service()
        .args(["--pace", "1"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    support::wait_for_status(robot, |status| {
        status["order"] == "driving" && status["mission_time_s"].as_f64().unwrap() > 0.5
    });
    signal_process(cut.id(), Signal::KILL);
    cut.wait().unwrap();
    (directory, service)
}

#[test]
fn a_service_goes_on_with_the_mission_of_a_supervisor_that_was_killed_just_now() {
    let (_runs, service) = killed_service("goes-on");
    let again = service().output().unwrap();
    assert_eq!(again.status.code(), Some(0), "{again:?}");
    let summary: serde_json::Value = serde_json::from_slice(&again.stdout).unwrap();
    assert_eq!(summary["resumes"], 1, "{summary}");
    assert_eq!(summary["outcome"], "reached", "{summary}");
    assert_nothing_left("goes-on");
}

#[test]
fn a_service_does_not_begin_a_mission_anew_that_was_cut_off_long_ago_until_told_again() {
    let (runs, service) = killed_service("cut");
    // As after a start of the machine: nothing says that it was a moment ago.
    let run = std::fs::read_dir(runs.path()).unwrap().next().unwrap();
    std::fs::remove_file(run.unwrap().path().join("supervisor.checkpoint")).unwrap();
    let again = service().output().unwrap();
    assert_eq!(again.status.code(), Some(7));
    let reason = String::from_utf8(again.stderr).unwrap();
    assert!(reason.contains("was cut off"), "{reason}");
    assert_eq!(service().output().unwrap().status.code(), Some(0));
    assert_nothing_left("cut");
}
