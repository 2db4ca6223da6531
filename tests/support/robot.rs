//! State of a robot: its status, processes and files.

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

use super::commands::{firsthand, output, start_piped};

pub const STAGES: [&str; 5] = ["link", "dead-reckoning", "mapper", "planner", "controller"];

/// Time limit of a wait, far above the duration of any awaited event.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Arguments of a run that outlasts its test on any machine.
pub const ENDLESS: &str = "--pace 1 --set controller.speed_m_s=0.002 --timeout 80000";

/// Calls `is_so` until it returns true, for at most [`PATIENCE`].
pub fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let began = Instant::now();
    while !is_so() {
        assert!(began.elapsed() < PATIENCE, "timeout before {what}");
        thread::sleep(Duration::from_millis(5));
    }
}

pub fn signal_process(pid: u32, signal: Signal) {
    let pid = Pid::from_raw(pid as i32).unwrap();
    kill_process(pid, signal).unwrap();
}

pub fn find<'a>(status: &'a Value, stage: &str) -> &'a Value {
    let stages = status["stages"].as_array().unwrap();
    stages.iter().find(|entry| entry["name"] == stage).unwrap()
}

pub fn pid(status: &Value, stage: &str) -> u32 {
    find(status, stage)["pid"].as_u64().unwrap() as u32
}

pub fn generation(status: &Value, stage: &str) -> u64 {
    find(status, stage)["generation"].as_u64().unwrap()
}

pub fn all_run(status: &Value) -> bool {
    let mut stages = STAGES.iter().map(|stage| find(status, stage));
    stages.all(|stage| stage["state"] == "running")
}

/// Replaces a middleware file by an incomplete one, as between its creation and completion.
pub fn half_make(path: &Path) {
    // An existing file may be read-only.
    let _ = fs::remove_file(path);
    let file = fs::File::create(path).unwrap();
    file.set_permissions(fs::Permissions::from_mode(0o200)).unwrap();
}

pub fn domain(robot: &str) -> Domain {
    suite();
    Domain::of(robot.parse().unwrap())
}

/// Returns the letters that mark the robots of this process and its children.
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

/// Returns `t` and the last four digits of the process number in base 36.
fn suite_of(process: u32) -> String {
    let place = |power| char::from_digit(process / 36_u32.pow(power) % 36, 36).unwrap();
    std::iter::once('t').chain([3, 2, 1, 0].map(place)).collect()
}

fn remove_ended_suites() {
    let entries = ["/tmp", "/dev/shm"].map(|directory| fs::read_dir(directory).unwrap().flatten());
    let entries: Vec<_> = entries.into_iter().flatten().collect();
    // Read after the files, so that it contains every suite that has any.
    let run = processes("").into_iter().map(|(pid, _)| suite_of(pid)).collect::<Vec<_>>();
    let left = |name: &str| {
        let name = name.strip_prefix("firsthand-").or_else(|| name.strip_prefix("fh"))?;
        let suite = name.get(..5).filter(|suite| suite.starts_with('t'))?;
        let whole = name.len() == 5 || name.as_bytes()[5] == b'_';
        (whole && !run.iter().any(|running| running == suite)).then_some(())
    };
    for entry in entries {
        if entry.file_name().to_str().and_then(left).is_some() {
            let path = entry.path();
            // Another suite may remove it meanwhile, and another user's cannot be removed.
            let _ = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
        }
    }
}

pub fn bus_instance(robot: &str) -> BusInstance {
    BusInstance::current(&domain(robot)).unwrap()
}

pub fn shared_memory(prefix: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir("/dev/shm").unwrap().flatten();
    let named = |name: &std::ffi::OsStr| name.as_encoded_bytes().starts_with(prefix.as_bytes());
    let entries = entries.filter(|entry| named(&entry.file_name()));
    entries.map(|entry| entry.path()).collect()
}

/// Returns the output of `firsthand status --json`, or `None` before the robot has a bus.
pub fn status_of(robot: &str) -> Option<Value> {
    let output = output(&["status", "--robot", robot, "--json"]);
    let text = output.status.success().then_some(output.stdout)?;
    serde_json::from_slice(&text).ok()
}

/// Follows a robot's status until `is_so` returns true, without a [`Run`](super::Run).
pub fn wait_for_status(robot: &str, is_so: impl Fn(&Value) -> bool) -> Value {
    follow_status(robot, is_so, || {})
}

/// Follows a robot's status until `is_so` returns true, and calls `check`, which may panic.
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
            // The creation or removal of a bus ends the follower.
            Err(RecvTimeoutError::Disconnected) => {
                drop(follower);
                (follower, lines) = start_follower(robot);
            }
        }
        check();
        assert!(began.elapsed() < PATIENCE, "timeout of robot {robot}");
    }
}

/// Starts a process that follows a robot's status. Returns it with its lines.
fn start_follower(robot: &str) -> (Killed, Receiver<String>) {
    let mut command = firsthand(&["status", "--follow", "--json", "--robot", robot]);
    let mut follower = Killed(start_piped(command.stderr(Stdio::null())));
    let lines = BufReader::new(follower.0.stdout.take().unwrap()).lines();
    let (sent, received) = mpsc::channel();
    thread::spawn(move || lines.map_while(Result::ok).try_for_each(|line| sent.send(line)));
    (follower, received)
}

/// Process that is killed when dropped.
pub struct Killed(pub Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Interval at which a test that follows a status checks for the end of the run.
const CHECK_EVERY: Duration = Duration::from_millis(100);

/// Makes a directory for a run of `robot`. The command lines of all its processes contain it.
pub fn directory_of(robot: &str) -> TempDir {
    let mut builder = tempfile::Builder::new();
    builder.prefix(&mark(robot)).tempdir().unwrap()
}

/// Asserts that no process, shared memory or file of `robot` is left.
#[track_caller]
pub fn assert_nothing_left(robot: &str) {
    // A stop guard ends after its link, when its robot is at rest or gone. A recorder whose
    // supervisor was killed first writes its last chunk.
    wait_until("no stop guard and no recorder is left", || {
        ["stop-guard", "firsthand record"].iter().all(|word| process_with(robot, word).is_none())
    });
    let domain = domain(robot);
    let shared = shared_memory(&domain.shared_memory_prefix());
    assert!(shared.is_empty(), "left in shared memory: {shared:?}");
    let directory = domain.directory();
    assert!(!directory.exists(), "{} is left", directory.display());
    let processes = processes_of(robot);
    assert!(processes.is_empty(), "{processes:?}");
}

/// Returns the prefix of the directories for runs of `robot` in this suite.
fn mark(robot: &str) -> String {
    format!("firsthand-{}_{robot}_", suite())
}

fn processes_of(robot: &str) -> Vec<(u32, String)> {
    processes(&mark(robot))
}

/// Returns the first of [`processes_with`].
pub fn process_with(robot: &str, word: &str) -> Option<u32> {
    processes_with(robot, word).first().copied()
}

/// Returns the processes of `robot` whose command line contains `word`.
pub fn processes_with(robot: &str, word: &str) -> Vec<u32> {
    let found = processes_of(robot).into_iter();
    found.filter(|(_, line)| line.contains(word)).map(|(pid, _)| pid).collect()
}

pub fn wait_until_all_ended(robot: &str) {
    wait_until("all have ended", || processes_of(robot).is_empty());
}

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
