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
        PATIENCE, Run, STAGES, assert_nothing_left, assert_said, directory_of, find, firsthand,
        kill, logged, operate, pid, reached, refused, signal_process, start_piped, start_quietly,
        status_of, wait_for_status, wait_until, wire::Robot,
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

    /// Waits for a line that starts with `start` and contains `parts`.
    fn hear_until(&self, start: &str, parts: &[&str]) {
        let mut message = [0; 4096];
        wait_until(start, || {
            let length = self.socket.recv(&mut message).unwrap();
            let text = String::from_utf8_lossy(&message[..length]);
            let mut lines = text.lines().filter(|line| line.starts_with(start));
            lines.any(|line| parts.iter().all(|part| line.contains(part)))
        });
    }
}

#[test]
fn systemd_hears_of_a_run_and_its_journal_of_deaths_and_a_frozen_supervisor_feeds_no_watchdog() {
    let robot = "notify";
    let manager = Manager::new();
    let directory = directory_of(robot);
    let run = directory.path().join("run");
    let journal = directory.path().join("journal");
    let file = fs::File::create(&journal).unwrap();
    let found = file.metadata().unwrap();
    let mut command = firsthand(&["run", "open-room", "--robot", robot, "--pace", "1", "--out"]);
    manager.adopt(command.arg(&run).stdout(Stdio::null()).stderr(file));
    command.args(["--set", "controller.speed_m_s=0.05"]);
    command.env("JOURNAL_STREAM", format!("{}:{}", found.dev(), found.ino()));
    let mut supervisor = command.spawn().unwrap();
    manager.hear_until("READY=1", &[]);
    // A loop that is late by half of the limit would be killed, so that much must be left.
    let mut fed = Instant::now();
    for _ in 0..3 {
        manager.hear_until("WATCHDOG=1", &[]);
        assert!(fed.elapsed() < WATCHDOG, "{:?}", fed.elapsed());
        fed = Instant::now();
    }
    manager.hear_until("STATUS=", &["to go", "5/5"]);
    let status = wait_for_status(robot, |status| status["order"] == "driving");
    signal_process(pid(&status, "mapper"), Signal::KILL);
    wait_for_status(robot, |status| find(status, "mapper")["generation"] == 2);

    signal_process(supervisor.id(), Signal::STOP);
    // Messages from before the freeze.
    manager.socket.set_nonblocking(true).unwrap();
    let mut message = [0; 4096];
    while manager.socket.recv(&mut message).is_ok() {}
    manager.socket.set_nonblocking(false).unwrap();
    manager.socket.set_read_timeout(Some(WATCHDOG)).unwrap();
    assert!(manager.socket.recv(&mut message).is_err(), "it speaks");
    manager.socket.set_read_timeout(Some(PATIENCE)).unwrap();
    signal_process(supervisor.id(), Signal::CONT);
    signal_process(supervisor.id(), Signal::TERM);
    manager.hear_until("STOPPING=1", &[]);
    assert_eq!(supervisor.wait().unwrap().code(), Some(0));

    let text = fs::read_to_string(journal).unwrap();
    let is_death = |line: &&str| line.contains("stage=\"mapper\"") && line.contains("cause=");
    assert!(text.lines().find(is_death).unwrap().starts_with("<4>"), "{text}");
    // Only the mission's title has no priority.
    let bare = text.lines().filter(|line| !line.starts_with('<'));
    assert_eq!(bare.count(), 1, "{text}");
    // The run directory also records the death. Stages log to files, without priorities.
    assert_eq!(logged(&run, "supervisor", &["WARN", "stage=\"mapper\"", "cause="]), 1);
    assert_eq!(logged(&run, "mapper", &["<6>"]), 0);
    assert_nothing_left(robot);
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
        Self { keepers: STAGES.map(keep).into(), over, directory }
    }

    /// Waits until all stages have ended in order. A busy supervisor may kill a stopped one before
    /// its process ends.
    fn assert_all_leave(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        for (stage, keeper) in std::mem::take(&mut self.keepers) {
            let code = keeper.join().unwrap();
            let log = fs::read_to_string(self.directory.path().join(stage)).unwrap();
            let stopped = log.contains("common::shell: stopped");
            assert!(stopped && code.is_none_or(|code| code == 0), "{stage}: {code:?}: {log}");
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
        let is_replaced = || status_of(robot).is_some_and(|status| status["order"] == "driving");
        if code == Some(0) && !is_replaced() || over.load(Ordering::Relaxed) {
            return last;
        }
    }
}

impl Drop for Units {
    /// Lets the stages end with their supervisor.
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
    }
}

fn watching(robot: &'static str, line: &str) -> (Run, Units) {
    let mut run = Run::start(robot, "obstacle-course", &format!("--watch-only {line}"));
    run.wait_until("there is a bus", |status| status["order"] == "starting");
    (run, Units::start(robot))
}

#[test]
fn external_stages_survive_kills_and_freezes_and_those_that_systemd_stops_are_no_deaths() {
    let robot = "units";
    // The mission is long enough for several kills on a busy machine.
    let (mut run, mut units) = watching(robot, "--pace 4");
    run.wait_until_under_way(1.0);
    run.kill_each(Signal::KILL);
    let status = run.kill_and_await_successor("mapper", Signal::STOP);
    let holder = pid(&status, "planner").to_string();
    let second = ["stage", "planner", "--robot", robot];
    assert_eq!(refused(&second, "", &["planner", &holder]), Some(1));
    run.wait_until_driving();
    // systemd does not restart a unit that it stops.
    units.over.store(true, Ordering::Relaxed);
    let deaths = run.records("deaths.jsonl").len();
    assert!(deaths > STAGES.len());
    for stage in STAGES.iter().rev() {
        signal_process(pid(&status, stage), Signal::TERM);
    }
    run.wait_until("all have ended", |status| {
        STAGES.iter().all(|stage| find(status, stage)["state"] == "down")
    });
    assert_eq!(run.records("deaths.jsonl").len(), deaths);
    run.stop();
    units.assert_all_leave();
}

#[test]
fn external_stages_stop_the_robot_and_end_with_a_killed_supervisor_and_a_frozen_one_with_the_next()
{
    let robot = "unit-orphan";
    let body = Robot::on_the_course();
    let tap = Tap::before(&body);
    let (mut run, mut units) = watching(robot, &tap.proxy.as_robot());
    let status = run.wait_until_under_way(1.0);
    // The kernel wakes a stage of the supervisor when its parent ends, but an external one stays
    // frozen.
    let (_, mapper) = units.keepers.remove(2);
    signal_process(pid(&status, "mapper"), Signal::STOP);
    run.kill();
    units.assert_all_leave();
    tap.assert_last_is_zero();
    Run::start(robot, "open-room", "").arrives();
    mapper.join().unwrap();
}

/// Returns the command that starts a service with `--resume-last`, each time in the same directory
/// of runs.
fn service<'a>(robot: &'a str, more: &'a [&'a str]) -> (TempDir, impl Fn() -> Command + 'a) {
    let directory = directory_of(robot);
    let runs = directory.path().to_path_buf();
    let service = move || {
        let mut command = firsthand(&["run", "open-room", "--robot", robot, "--json"]);
        command.args(more).arg("--resume-last").arg("--runs").arg(&runs);
        command
    };
    (directory, service)
}

fn kill_while_it_drives(robot: &str, service: &mut Command) {
    let mut cut = start_quietly(service.args(["--pace", "1"]));
    wait_for_status(robot, |status| {
        status["order"] == "driving" && status["mission_time_s"].as_f64().unwrap() > 0.5
    });
    kill(&mut cut);
}

#[test]
fn a_service_that_was_cut_off_comes_up_stands_says_where_it_is_and_goes_on_when_told() {
    let (_runs, service) = service("cut", &[]);
    kill_while_it_drives("cut", &mut service());
    let again = start_piped(service().stderr(Stdio::piped()));
    wait_for_status("cut", |status| status["order"] == "stopped by an operator");
    operate("cut", "resume");
    let again = again.wait_with_output().unwrap();
    assert_said(&again, &["believes it is where it stood", "firsthand resume"]);
    assert_eq!(reached(&again)["resumes"], 1, "{again:?}");
    assert_nothing_left("cut");
}

#[test]
fn a_service_goes_on_by_itself_if_its_mission_says_so_and_begins_anew_after_another_version() {
    let robot = "updated";
    let (runs, service) = service(robot, &["--set", "resume='automatic'"]);
    kill_while_it_drives(robot, &mut service());
    // It goes on.
    kill_while_it_drives(robot, &mut service());
    let directory = runs.path().join("open-room-001");
    for entry in fs::read_dir(&directory).unwrap().flatten() {
        let mut bytes = fs::read(entry.path()).unwrap();
        for at in 0..bytes.len().saturating_sub(4) {
            if bytes[at..].starts_with(b"FHC") {
                bytes[at + 3] = b'1';
            }
        }
        fs::write(entry.path(), bytes).unwrap();
    }
    assert_eq!(fs::read_dir(runs.path()).unwrap().count(), 1);
    let resume = ["run", "--resume", directory.to_str().unwrap()];
    refused(&resume, "other-version", &[".checkpoint"]);
    let again = service().output().unwrap();
    assert_said(&again, &["the last run ends here", "version 1, not"]);
    assert_eq!(reached(&again)["resumes"], 0, "{again:?}");
    assert_nothing_left(robot);
}

#[test]
fn a_service_that_stays_begins_where_it_stood_when_it_was_stopped_and_waits() {
    let place = ["perimeter.width_m=8.0", "target=[0.9, 0.3]"];
    let stays = ["--stay", "--pace", "2", "--set", place[0], "--set", place[1]];
    let (_runs, service) = service("begins", &stays);
    let mut first = start_quietly(&mut service());
    wait_for_status("begins", |status| status["order"] == "waiting for a target");
    signal_process(first.id(), Signal::TERM);
    first.wait().unwrap();
    // Its mission has a target, so it stands.
    let mut again = start_quietly(&mut service());
    let status = wait_for_status("begins", |status| {
        status["order"] == "stopped by an operator" && status["pose"]["x_m"].is_f64()
    });
    let at = |key: &str| status["pose"][key].as_f64().unwrap();
    assert!((at("x_m") - 0.9).hypot(at("y_m") - 0.3) < 0.25, "{status}");
    assert!(at("within_m") > 0.0, "{status}");
    signal_process(again.id(), Signal::TERM);
    again.wait().unwrap();
    assert_nothing_left("begins");
}
