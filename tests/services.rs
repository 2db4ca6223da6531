//! Tests of runs under a service manager, which the tests replace.

use std::{
    fs,
    os::unix::{fs::MetadataExt, net::UnixDatagram},
    path::Path,
    process::{Command, Stdio},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use crate::{
    failsafe::Tap,
    support::{
        self, PATIENCE, Run, assert_nothing_left, assert_reached, find, firsthand, signal_process,
        wire::Robot,
    },
};
use rustix::process::Signal;
use tempfile::TempDir;

/// WatchdogSec of a unit.
const WATCHDOG: Duration = Duration::from_secs(2);

/// Socket on which a service reports its state.
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

    /// Sets the environment that systemd would give `command`.
    fn adopt(&self, command: &mut Command) {
        command
            .env("NOTIFY_SOCKET", self.directory.path().join("notify"))
            .env("WATCHDOG_USEC", WATCHDOG.as_micros().to_string());
    }

    /// Returns the lines of the next message.
    fn hear(&self) -> Vec<String> {
        let mut message = [0; 4096];
        let length = self.socket.recv(&mut message).unwrap();
        let text = String::from_utf8(message[..length].to_vec()).unwrap();
        text.lines().map(str::to_owned).collect()
    }

    /// Returns all lines up to the message with `line`.
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
    command.arg(directory.path().join("run"));
    command.stdout(Stdio::null()).stderr(Stdio::null());
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
    // A loop that is late by half of the limit would be killed, so that much must be left.
    let mut fed = Instant::now();
    for _ in 0..3 {
        manager.hear_until("WATCHDOG=1");
        assert!(fed.elapsed() < WATCHDOG, "{:?}", fed.elapsed());
        fed = Instant::now();
    }
    let heard = manager.hear_until_status();
    assert!(heard.contains("5/5"), "{heard}");
    signal_process(run.id(), Signal::TERM);
    manager.hear_until("STOPPING=1");
    assert_eq!(run.wait().unwrap().code(), Some(0));
    assert_nothing_left("notify");
}

impl Manager {
    /// Returns the status line of a driving robot.
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
    // Messages from before the freeze.
    manager.socket.set_nonblocking(true).unwrap();
    let mut message = [0; 4096];
    while manager.socket.recv(&mut message).is_ok() {}
    manager.socket.set_nonblocking(false).unwrap();
    manager.socket.set_read_timeout(Some(WATCHDOG)).unwrap();
    assert!(manager.socket.recv(&mut message).is_err(), "it speaks");
    // systemd would kill it. The stages then end, too, and the next run is not hindered.
    signal_process(run.id(), Signal::KILL);
    run.wait().unwrap();
    Run::start("hang", "open-room", &[]).arrives();
}

#[test]
fn in_a_journal_a_stages_death_has_its_priority() {
    let directory = support::directory_of("journal");
    let journal = fs::File::create(directory.path().join("journal")).unwrap();
    let found = journal.metadata().unwrap();
    let mut run = mission("journal", &directory)
        .env("JOURNAL_STREAM", format!("{}:{}", found.dev(), found.ino()))
        .stderr(journal)
        .spawn()
        .unwrap();
    let status = support::wait_for_status("journal", |status| status["order"] == "driving");
    let mapper = find(&status, "mapper")["pid"].as_u64().unwrap();
    signal_process(mapper as u32, Signal::KILL);
    support::wait_for_status("journal", |status| find(status, "mapper")["generation"] == 2);
    let journal = || fs::read_to_string(directory.path().join("journal")).unwrap();
    support::wait_until("the title is shown", || {
        journal().lines().any(|line| !line.starts_with('<'))
    });
    signal_process(run.id(), Signal::TERM);
    run.wait().unwrap();
    let text = journal();
    let is_death = |line: &&str| line.contains("stage=\"mapper\"") && line.contains("cause=");
    let death = text.lines().find(is_death).unwrap();
    assert!(death.starts_with("<4>"), "{text}");
    // Only the mission's title has no priority.
    let bare = text.lines().filter(|line| !line.starts_with('<'));
    assert_eq!(bare.count(), 1, "{text}");
    // The run directory also records the death. Stages log to files, without priorities.
    let run = directory.path().join("run");
    let death = ["WARN", "stage=\"mapper\"", "cause="];
    assert_eq!(support::logged(&run, "supervisor", &death), 1);
    assert_eq!(support::logged(&run, "mapper", &["<6>"]), 0);
}

/// Stages that this test starts and restarts, like systemd with `Restart=always`.
struct Units {
    keepers: Vec<(&'static str, JoinHandle<Option<i32>>)>,
    over: Arc<AtomicBool>,
    // Directory of the stages' logs.
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
        Self { keepers: support::STAGES.map(keep).into(), over, directory }
    }

    /// Waits until all stages have ended in order. A busy supervisor may kill a stopped one before
    /// its process ends.
    fn assert_all_leave(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        for (stage, keeper) in std::mem::take(&mut self.keepers) {
            let code = keeper.join().unwrap();
            let log = fs::read_to_string(self.directory.path().join(stage)).unwrap();
            let stopped = log.contains("common::shell: stopped");
            assert!(stopped && code.is_none_or(|code| code == 0), "{stage}: {code:?}");
        }
    }
}

/// Restarts a stage until it ends in order with its run, or `over` is set. Returns the last exit
/// code except refusals without a supervisor.
fn keep_up(robot: &str, stage: &str, log: &Path, over: &AtomicBool) -> Option<i32> {
    let mut last = None;
    loop {
        let mut append = fs::File::options();
        let log = append.create(true).append(true).open(log).unwrap();
        let mut command = firsthand(&["stage", stage, "--robot", robot]);
        let code = command.stderr(log).status().unwrap().code();
        if code != Some(1) {
            last = code;
        }
        // The supervisor of a stalled robot replaces the planner, which also ends in order.
        let is_replaced =
            || support::status_of(robot).is_some_and(|status| status["order"] == "driving");
        if code == Some(0) && !is_replaced() || over.load(Ordering::Relaxed) {
            return last;
        }
    }
}

impl Drop for Units {
    /// Waits for the stages to end with their supervisor. A failed test prints their logs.
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        for stage in support::STAGES.iter().filter(|_| thread::panicking()) {
            let log = fs::read_to_string(self.directory.path().join(stage));
            eprintln!("{stage}: {}", log.unwrap_or_default());
        }
    }
}

fn watching(robot: &'static str) -> (Run, Units) {
    // The mission is long enough for several kills on a busy machine.
    watching_with(robot, &["--pace", "4", "--set", "controller.speed_m_s=0.2"])
}

fn watching_with(robot: &'static str, arguments: &[&str]) -> (Run, Units) {
    let arguments = [&["--watch-only"], arguments].concat();
    let mut run = Run::start(robot, "obstacle-course", &arguments);
    run.wait_until("there is a bus", |status| status["order"] == "starting");
    (run, Units::start(robot))
}

#[test]
fn external_stages_drive_and_survive_kills_under_a_supervisor_that_only_watches() {
    let (mut run, mut units) = watching("units");
    run.wait_until_under_way(2.0);
    run.kill_each(Signal::KILL);
    let (code, summary) = run.finish();
    assert_reached(code, &summary);
    for stage in support::STAGES {
        assert!(summary["restarts"][stage].as_u64() >= Some(1), "{summary}");
    }
    units.assert_all_leave();
    assert_nothing_left("units");
}

#[test]
fn a_frozen_external_stage_is_ended_by_the_supervisor_that_only_watches() {
    let (mut run, mut units) = watching("unit-hang");
    let status = run.wait_until_under_way(1.0);
    run.kill_and_await("mapper", Signal::STOP, &status);
    run.signal(Signal::TERM);
    assert_eq!(run.finish().0, Some(0));
    units.assert_all_leave();
    assert_nothing_left("unit-hang");
}

#[test]
fn external_stages_that_systemd_stops_before_their_supervisor_are_no_deaths() {
    let (mut run, mut units) = watching("unit-order");
    let status = run.wait_until_under_way(1.0);
    let status = run.kill_and_await("planner", Signal::KILL, &status);
    // systemd does not restart a unit that it stops.
    units.over.store(true, Ordering::Relaxed);
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
    let body = Robot::on_the_course();
    let tap = Tap::before(&body);
    let address = tap.proxy.as_robot();
    let (mut run, mut units) = watching_with(robot, &["--set", &address]);
    run.wait_until_under_way(1.0);
    run.kill();
    units.assert_all_leave();
    tap.assert_last_is_zero();
    Run::start(robot, "open-room", &[]).arrives();
}

#[test]
fn a_frozen_external_stage_that_outlives_its_supervisor_does_not_hinder_the_next() {
    // The kernel wakes a stage of the supervisor when its parent ends, but an external one stays
    // frozen.
    let robot = "frozen-orphan";
    let mut watching = Run::start(robot, "obstacle-course", &["--watch-only"]);
    watching.wait_until("there is a bus", |_| true);
    let mut mapper = firsthand(&["stage", "mapper", "--robot", robot]);
    let mut mapper = mapper.spawn().unwrap();
    watching.wait_until("the mapper runs", |status| find(status, "mapper")["state"] == "running");
    signal_process(mapper.id(), Signal::STOP);
    watching.kill();
    Run::start(robot, "open-room", &[]).arrives();
    let ended = mapper.try_wait().unwrap();
    mapper.kill().unwrap();
    mapper.wait().unwrap();
    assert!(ended.is_some(), "the frozen stage is still there");
}

#[test]
fn a_stage_without_a_place_is_refused_with_the_remedy() {
    let mapper_is_refused = |robot: &str, names: &[&str]| {
        let mapper = ["stage", "mapper", "--robot", robot];
        assert_eq!(support::refused(&mapper, "", names), Some(1));
    };
    mapper_is_refused("nobody", &["nobody", "--watch-only"]);

    let mut own = Run::start("own", "open-room", &["--pace", "1"]);
    own.wait_until_driving();
    mapper_is_refused("own", &["own", "--watch-only"]);
    own.stop();

    let (mut run, units) = watching("taken");
    let status = run.wait_until_under_way(0.5);
    let holder = support::pid(&status, "mapper").to_string();
    mapper_is_refused("taken", &["mapper", &holder]);
    run.signal(Signal::TERM);
    run.finish();
    drop(units);
}

/// Returns the command that starts a service with `--resume-last`, each time in the same directory
/// of runs.
fn service(robot: &'static str, more: &'static [&'static str]) -> (TempDir, impl Fn() -> Command) {
    let directory = support::directory_of(robot);
    let runs = directory.path().to_path_buf();
    let service = move || {
        let mut command = firsthand(&["run", "open-room", "--robot", robot, "--json"]);
        command.args(more).arg("--resume-last").arg("--runs").arg(&runs);
        command
    };
    (directory, service)
}

fn kill_while_it_drives(robot: &str, service: &mut Command) {
    let mut cut = support::start_quietly(service.args(["--pace", "1"]));
    support::wait_for_status(robot, |status| {
        status["order"] == "driving" && status["mission_time_s"].as_f64().unwrap() > 0.5
    });
    signal_process(cut.id(), Signal::KILL);
    cut.wait().unwrap();
}

#[test]
fn a_service_whose_mission_says_so_goes_on_by_itself_after_it_was_killed() {
    let (_runs, service) = service("goes-on", &["--set", "resume='automatic'"]);
    kill_while_it_drives("goes-on", &mut service());
    let (exit, summary) = support::json_of(&service().output().unwrap());
    assert_reached(exit.code(), &summary[0]);
    assert_eq!(summary[0]["resumes"], 1, "{summary:?}");
    assert_nothing_left("goes-on");
}

#[test]
fn a_service_that_was_cut_off_comes_up_stands_says_where_it_is_and_goes_on_when_told() {
    let (_runs, service) = service("cut", &[]);
    kill_while_it_drives("cut", &mut service());
    let again = service().stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let stands = |status: &serde_json::Value| status["order"] == "stopped by an operator";
    support::wait_for_status("cut", stands);
    support::operate("cut", &["resume"]);
    let again = again.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&again.stderr);
    assert!(
        said.contains("believes it is where it stood") && said.contains("firsthand resume"),
        "{said}"
    );
    let (exit, summary) = support::json_of(&again);
    assert_reached(exit.code(), &summary[0]);
    assert_eq!(summary[0]["resumes"], 1, "{summary:?}");
    assert_nothing_left("cut");
}

#[test]
fn a_service_begins_anew_after_a_run_of_another_version_and_says_so() {
    let robot = "updated";
    let (runs, service) = service(robot, &["--set", "resume='automatic'"]);
    kill_while_it_drives(robot, &mut service());
    for entry in fs::read_dir(runs.path().join("open-room-001")).unwrap().flatten() {
        let mut bytes = fs::read(entry.path()).unwrap();
        for at in 0..bytes.len().saturating_sub(4) {
            if bytes[at..].starts_with(b"FHC") {
                bytes[at + 3] = b'1';
            }
        }
        fs::write(entry.path(), bytes).unwrap();
    }
    let again = service().output().unwrap();
    let said = String::from_utf8_lossy(&again.stderr);
    assert!(said.contains("the last run ends here") && said.contains("version 1, not"), "{said}");
    let (exit, summary) = support::json_of(&again);
    assert_reached(exit.code(), &summary[0]);
    assert_eq!(summary[0]["resumes"], 0, "{summary:?}");
    assert_nothing_left(robot);
}

#[test]
fn a_service_that_stays_begins_where_it_stood_when_it_was_stopped_and_waits() {
    const STAYS: [&str; 6] = ["--stay", "--pace", "2", "--set", "perimeter.width_m=8.0", "--set"];
    let (_runs, service) = service(
        "begins",
        &[STAYS[0], STAYS[1], STAYS[2], STAYS[3], STAYS[4], STAYS[5], "target=[0.9, 0.3]"],
    );
    let mut first = support::start_quietly(&mut service());
    let waits = |status: &serde_json::Value| status["order"] == "waiting for a target";
    support::wait_for_status("begins", waits);
    signal_process(first.id(), Signal::TERM);
    first.wait().unwrap();
    // Its mission has a target, so it stands.
    let mut again = support::start_quietly(&mut service());
    let status = support::wait_for_status("begins", |status| {
        status["order"] == "stopped by an operator" && status["pose"]["x_m"].is_f64()
    });
    let at = |key: &str| status["pose"][key].as_f64().unwrap();
    assert!((at("x_m") - 0.9).hypot(at("y_m") - 0.3) < 0.25, "{status}");
    assert!(at("within_m") > 0.0, "{status}");
    signal_process(again.id(), Signal::TERM);
    again.wait().unwrap();
    assert_nothing_left("begins");
}
