//! The state of a robot: its status, its processes, its files.

use std::{
    fs,
    io::{BufRead as _, BufReader},
    os::unix::fs::PermissionsExt as _,
    path::{Path, PathBuf},
    process::{Child, Stdio},
    sync::{
        LazyLock,
        mpsc::{self, Receiver, RecvTimeoutError},
    },
    thread,
    time::{Duration, Instant},
};

use common::{
    bus_instance::BusInstance,
    domain::{Domain, SUITE_VARIABLE, set_apart},
};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use tempfile::TempDir;

use super::commands::{firsthand, output};

/// Every stage, in the order of the pipeline.
pub const STAGES: [&str; 5] = ["link", "dead-reckoning", "mapper", "planner", "controller"];

/// The time after which a wait has failed, because no event that a test waits for takes nearly as long.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Call `is_so` until it returns true, for [`PATIENCE`] at most.
pub fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let began = Instant::now();
    while !is_so() {
        assert!(began.elapsed() < PATIENCE, "waited too long until {what}");
        // The processes that are waited for need the processor.
        thread::sleep(Duration::from_millis(5));
    }
}

pub fn signal_process(pid: u32, signal: Signal) {
    let pid = Pid::from_raw(pid as i32).unwrap();
    kill_process(pid, signal).unwrap();
}

/// The entry of `stage` in a status.
pub fn find<'a>(status: &'a Value, stage: &str) -> &'a Value {
    let stages = status["stages"].as_array().unwrap();
    stages.iter().find(|entry| entry["name"] == stage).unwrap()
}

/// The process number of `stage` in a status.
pub fn pid(status: &Value, stage: &str) -> u32 {
    find(status, stage)["pid"].as_u64().unwrap() as u32
}

/// The generation of `stage` in a status.
pub fn generation(status: &Value, stage: &str) -> u64 {
    find(status, stage)["generation"].as_u64().unwrap()
}

/// Whether all stages run.
pub fn all_run(status: &Value) -> bool {
    let mut stages = STAGES.iter().map(|stage| find(status, stage));
    stages.all(|stage| stage["state"] == "running")
}

/// Replace a file of the middleware by an unfilled one, as it is between its creation and its completion.
pub fn half_make(path: &Path) {
    // An existing file may not be writable.
    let _ = fs::remove_file(path);
    let file = fs::File::create(path).unwrap();
    file.set_permissions(fs::Permissions::from_mode(0o200)).unwrap();
}

pub fn domain(robot: &str) -> Domain {
    suite();
    Domain::of(robot.parse().unwrap())
}

/// The letters that set the robots of this process, and of those that it starts, apart from all others on the machine.
pub fn suite() -> &'static str {
    static SUITE: LazyLock<String> = LazyLock::new(|| {
        let suite = std::env::var(SUITE_VARIABLE).unwrap_or_else(|_| {
            remove_ended_suites();
            suite_of(std::process::id())
        });
        set_apart(&suite);
        suite
    });
    &SUITE
}

/// `t` and the last four digits of the process number to the base 36.
fn suite_of(process: u32) -> String {
    let place = |power| char::from_digit(process / 36_u32.pow(power) % 36, 36).unwrap();
    std::iter::once('t').chain([3, 2, 1, 0].map(place)).collect()
}

/// Remove the files of suites that were killed.
fn remove_ended_suites() {
    let run = processes("").into_iter().map(|(pid, _)| suite_of(pid)).collect::<Vec<_>>();
    let left = |name: &str| {
        let name = name.strip_prefix("firsthand-").or_else(|| name.strip_prefix("fh"))?;
        let suite = name.get(..5).filter(|suite| suite.starts_with('t'))?;
        let whole = name.len() == 5 || name.as_bytes()[5] == b'_';
        (whole && !run.iter().any(|running| running == suite)).then_some(())
    };
    let entries = ["/tmp", "/dev/shm"].map(|directory| fs::read_dir(directory).unwrap().flatten());
    for entry in entries.into_iter().flatten() {
        if entry.file_name().to_str().and_then(left).is_some() {
            let path = entry.path();
            // Another suite may remove it at the same time, and another user's cannot be removed.
            let _ = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
        }
    }
}

/// The current bus instance of `robot`.
pub fn bus_instance(robot: &str) -> BusInstance {
    BusInstance::current(&domain(robot)).unwrap()
}

/// The files in shared memory whose names start with `prefix`.
pub fn shared_memory(prefix: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir("/dev/shm").unwrap().flatten();
    let named = |name: &std::ffi::OsStr| name.as_encoded_bytes().starts_with(prefix.as_bytes());
    let entries = entries.filter(|entry| named(&entry.file_name()));
    entries.map(|entry| entry.path()).collect()
}

/// The answer of `firsthand status --json`; none before the robot has a bus.
pub fn status_of(robot: &str) -> Option<Value> {
    let output = output(&["status", "--robot", robot, "--json"]);
    let text = output.status.success().then_some(output.stdout)?;
    serde_json::from_slice(&text).ok()
}

/// Follow the status of a robot until `is_so` returns true, for a robot without a [`Run`](super::Run).
pub fn wait_for_status(robot: &str, is_so: impl Fn(&Value) -> bool) -> Value {
    follow_status(robot, is_so, || {})
}

/// Follow the status of a robot until `is_so` returns true. `check` is called meanwhile, and may panic.
pub fn follow_status(
    robot: &str,
    is_so: impl Fn(&Value) -> bool,
    mut check: impl FnMut(),
) -> Value {
    let began = Instant::now();
    let (mut follower, mut lines) = start_follower(robot);
    loop {
        match lines.recv_timeout(CHECK_EVERY) {
            Ok(line) => {
                let status = serde_json::from_str(&line).unwrap();
                if is_so(&status) {
                    return status;
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            // A bus that is being made or removed ends the follower.
            Err(RecvTimeoutError::Disconnected) => {
                drop(follower);
                (follower, lines) = start_follower(robot);
            }
        }
        check();
        assert!(began.elapsed() < PATIENCE, "waited too long for robot {robot}");
    }
}

/// A process that follows the status of a robot, and its lines.
fn start_follower(robot: &str) -> (Killed, Receiver<String>) {
    let mut command = firsthand(&["status", "--follow", "--json", "--robot", robot]);
    let follower = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let mut follower = Killed(follower);
    let lines = BufReader::new(follower.0.stdout.take().unwrap()).lines();
    let (sent, received) = mpsc::channel();
    thread::spawn(move || lines.map_while(Result::ok).try_for_each(|line| sent.send(line)));
    (follower, received)
}

/// A process that is killed when this is dropped.
struct Killed(Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// How often a test that follows a status looks whether the robot's run has ended.
const CHECK_EVERY: Duration = Duration::from_millis(100);

/// A directory for a run of `robot`. The command lines of all processes of the run contain it.
pub fn directory_of(robot: &str) -> TempDir {
    let mut builder = tempfile::Builder::new();
    builder.prefix(&mark(robot)).tempdir().unwrap()
}

/// Assert that no process, no shared memory and no file of `robot` is left.
#[track_caller]
pub fn assert_nothing_left(robot: &str) {
    // A stop guard ends after its link, when its robot rests or is gone; a recorder whose supervisor was killed first writes its last
    // chunk.
    wait_until("no stop guard and no recorder is left", || {
        let lasts =
            |line: &String| line.contains("stop-guard") || line.contains("firsthand record");
        !processes_of(robot).iter().any(lasts)
    });
    let domain = domain(robot);
    let shared = shared_memory(&domain.shared_memory_prefix());
    assert!(shared.is_empty(), "left in shared memory: {shared:?}");
    let directory = domain.directory();
    assert!(!directory.exists(), "{} is left", directory.display());
    assert_eq!(processes_of(robot), Vec::<String>::new());
}

/// The names of all directories for runs of `robot` in this suite start with this.
fn mark(robot: &str) -> String {
    format!("firsthand-{}_{robot}_", suite())
}

/// The command lines of the processes of `robot`: supervisor, stages, simulator.
pub fn processes_of(robot: &str) -> Vec<String> {
    let found = processes(&mark(robot)).into_iter();
    found.map(|(_, line)| line).collect()
}

/// The numbers of the processes of `robot`.
pub fn pids_of(robot: &str) -> Vec<u32> {
    let found = processes(&mark(robot)).into_iter();
    found.map(|(pid, _)| pid).collect()
}

/// Wait until no process of `robot` runs any more.
pub fn wait_until_all_ended(robot: &str) {
    wait_until("all have ended", || pids_of(robot).is_empty());
}

/// The numbers and command lines of the processes whose command lines contain `mark`.
pub fn processes(mark: &str) -> Vec<(u32, String)> {
    let entries = fs::read_dir("/proc").unwrap().flatten();
    let found = entries.filter_map(|entry| {
        let pid = entry.file_name().to_str()?.parse().ok()?;
        let line = fs::read(entry.path().join("cmdline")).ok()?;
        let line = String::from_utf8_lossy(&line).replace('\0', " ");
        line.contains(mark).then_some((pid, line))
    });
    found.collect()
}
