//! What the system tests share: the real executable, robots of their own, states to wait for.
#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::panic,
    missing_docs,
    unreachable_pub
)]

use std::{
    fs,
    io::Read as _,
    os::unix::fs::PermissionsExt as _,
    path::Path,
    process::{Child, Command, Output, Stdio},
    time::{Duration, Instant},
};

use common::{bus_instance::BusInstance, domain::Domain};
use recording::Recording;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use tempfile::TempDir;

/// Run `test` in a process of its own: what it leaves behind of the bus of its robot ends with it.
pub fn in_own_process<T: FnOnce()>(test: T) {
    // The closure's name is the test's, in its crate: CRATE::MODULE::TEST::{{closure}}.
    let (_, name) = std::any::type_name::<T>().split_once("::").unwrap();
    let name = name.strip_suffix("::{{closure}}").unwrap();
    if std::env::var_os(OWN_PROCESS).is_some_and(|chosen| chosen == name) {
        return test();
    }
    let output = Command::new(std::env::current_exe().unwrap())
        .args([name, "--exact", "--nocapture"])
        .env(OWN_PROCESS, name)
        .output()
        .unwrap();
    let (said, failed) = (
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr),
    );
    let passed = output.status.success() && said.contains("1 passed");
    assert!(passed, "{said}\n{failed}");
}

/// Names the one test that a process is for.
const OWN_PROCESS: &str = "FIRSTHAND_TEST";

/// Every stage, in the order of the pipeline.
pub const STAGES: [&str; 5] = [
    "x80-link",
    "dead-reckoning",
    "mapper",
    "planner",
    "controller",
];

/// Nothing a test waits for takes nearly as long; what does is broken.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// `firsthand` with these arguments.
pub fn firsthand(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_firsthand"));
    command.args(arguments).stdin(Stdio::null());
    command
}

/// Run it to its end.
pub fn output(arguments: &[&str]) -> Output {
    firsthand(arguments).output().unwrap()
}

/// `firsthand` with these arguments for `robot`, which must succeed.
pub fn operate(robot: &str, arguments: &[&str]) {
    let arguments = [arguments, &["--robot", robot]].concat();
    let output = output(&arguments);
    assert!(output.status.success(), "{arguments:?}: {output:?}");
}

/// A run of a mission by a robot of its own.
pub struct Run {
    pub robot: String,
    child: Option<Child>,
    // Removed when the test ends.
    directory: TempDir,
}

impl Run {
    /// Start `firsthand run MISSION --robot ROBOT --json` with further arguments.
    pub fn start(robot: &str, mission: &str, arguments: &[&str]) -> Self {
        let directory = directory_of(robot);
        let out = directory.path().join("run");
        let child = firsthand(&["run", mission, "--robot", robot, "--json", "--out"])
            .arg(&out)
            .args(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        Self {
            robot: robot.to_owned(),
            child: Some(child),
            directory,
        }
    }

    pub fn directory(&self) -> std::path::PathBuf {
        self.directory.path().join("run")
    }

    /// The lines of a file of records in the run directory.
    pub fn records(&self, file: &str) -> Vec<Value> {
        records(&self.directory().join(file))
    }

    pub fn is_running(&mut self) -> bool {
        let child = self.child.as_mut().unwrap();
        child.try_wait().unwrap().is_none()
    }

    pub fn pid(&self) -> u32 {
        self.child.as_ref().unwrap().id()
    }

    /// As [`status_of`].
    pub fn status(&self) -> Option<Value> {
        status_of(&self.robot)
    }

    /// Ask for the status until `is_so` of it: each answer waits for what the supervisor publishes next.
    pub fn wait_until(&mut self, what: &str, is_so: impl Fn(&Value) -> bool) -> Value {
        let began = Instant::now();
        loop {
            if let Some(status) = self.status()
                && is_so(&status)
            {
                return status;
            }
            let child = self.child.as_mut().unwrap();
            if let Some(exit) = child.try_wait().unwrap() {
                let mut said = String::new();
                let _ = child.stderr.take().unwrap().read_to_string(&mut said);
                panic!("the run ended ({exit}) before {what}: {said}");
            }
            assert!(began.elapsed() < PATIENCE, "waited too long for {what}");
        }
    }

    /// Until the robot has been under way for `seconds` of mission time.
    pub fn wait_until_under_way(&mut self, seconds: f64) -> Value {
        self.wait_until("the robot is under way", |status| {
            status["mission_time_s"].as_f64().unwrap() >= seconds
        })
    }

    /// Wait until the supervisor itself is gone.
    pub fn reap(&mut self) {
        self.child.as_mut().unwrap().wait().unwrap();
    }

    pub fn signal(&self, signal: Signal) {
        signal_process(self.pid(), signal);
    }

    /// Kill a stage, or freeze it (`Signal::STOP`), and wait until its successor runs; the status then.
    pub fn kill_and_await_successor(&mut self, stage: &str, signal: Signal) -> Value {
        let status = self.wait_until("the stage runs", |status| {
            find(status, stage)["state"] == "running"
        });
        self.kill_and_await(stage, signal, &status)
    }

    /// The same of a stage that runs in `status`, when no further status can be had.
    pub fn kill_and_await(&mut self, stage: &str, signal: Signal, status: &Value) -> Value {
        let generation = find(status, stage)["generation"].as_u64().unwrap();
        signal_process(pid(status, stage), signal);
        self.wait_until("its successor runs", |status| {
            let stage = find(status, stage);
            stage["generation"].as_u64() > Some(generation) && stage["state"] == "running"
        })
    }

    /// Wait for the end: exit code, and the JSON of the last line.
    pub fn finish(mut self) -> (Option<i32>, Value) {
        let output = self.child.take().unwrap().wait_with_output().unwrap();
        let text = String::from_utf8(output.stdout).unwrap();
        let last = text.lines().last().unwrap_or_default();
        let summary = serde_json::from_str(last).unwrap_or_else(|_| {
            panic!(
                "no JSON in {text:?}; stderr: {}",
                String::from_utf8_lossy(&output.stderr)
            )
        });
        (output.status.code(), summary)
    }

    /// Wait for the end; the run directory with it.
    pub fn finish_in(mut self) -> (Option<i32>, Value, TempDir) {
        let kept = std::mem::replace(&mut self.directory, tempfile::tempdir().unwrap());
        let (code, summary) = self.finish();
        (code, summary, kept)
    }
}

/// A test that fails leaves no process behind: the stages go with their supervisor.
impl Drop for Run {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// The lines of a file of records: a JSON value each, none before the first.
pub fn records(file: &Path) -> Vec<Value> {
    let text = fs::read_to_string(file).unwrap_or_default();
    let lines = text.lines().map(|line| serde_json::from_str(line).unwrap());
    lines.collect()
}

/// A whole run.
pub fn run(robot: &str, mission: &str, arguments: &[&str]) -> (Option<i32>, Value) {
    Run::start(robot, mission, arguments).finish()
}

/// Seconds of a mission, committed.
pub fn golden() -> Recording {
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/golden/open-room.mcap"
    );
    Recording::open(file.as_ref()).unwrap()
}

pub fn signal_process(pid: u32, signal: Signal) {
    let pid = Pid::from_raw(pid as i32).unwrap();
    kill_process(pid, signal).unwrap();
}

/// A stage's part of a status.
pub fn find<'a>(status: &'a Value, stage: &str) -> &'a Value {
    let stages = status["stages"].as_array().unwrap();
    stages.iter().find(|entry| entry["name"] == stage).unwrap()
}

/// Its process.
pub fn pid(status: &Value, stage: &str) -> u32 {
    find(status, stage)["pid"].as_u64().unwrap() as u32
}

/// A file of the middleware as it is between its creation and its completion.
pub fn half_make(path: &Path) {
    // One that is there may not be writable.
    let _ = fs::remove_file(path);
    let file = fs::File::create(path).unwrap();
    file.set_permissions(fs::Permissions::from_mode(0o200))
        .unwrap();
}

/// The bus of `robot` that is there.
pub fn making(robot: &str) -> BusInstance {
    BusInstance::current(&Domain::of(robot.parse().unwrap())).unwrap()
}

/// `firsthand status --json`; none before the robot has a bus.
pub fn status_of(robot: &str) -> Option<Value> {
    let output = output(&["status", "--robot", robot, "--json"]);
    let text = output.status.success().then_some(output.stdout)?;
    serde_json::from_slice(&text).ok()
}

/// Ask for the status of a robot that no [`Run`] stands for until `is_so` of it.
pub fn wait_for_status(robot: &str, is_so: impl Fn(&Value) -> bool) -> Value {
    let began = Instant::now();
    loop {
        match status_of(robot) {
            Some(status) if is_so(&status) => return status,
            last => assert!(began.elapsed() < PATIENCE, "waited too long: {last:?}"),
        }
    }
}

/// A directory for a run of `robot`: every process of the run has it on its command line.
pub fn directory_of(robot: &str) -> TempDir {
    let mut builder = tempfile::Builder::new();
    builder.prefix(&mark(robot)).tempdir().unwrap()
}

/// Nothing of `robot` is left: no process, no shared memory, no files.
pub fn assert_nothing_left(robot: &str) {
    let user = rustix::process::geteuid().as_raw();
    let prefix = format!("fh{user}_{robot}_");
    let shared: Vec<_> = fs::read_dir("/dev/shm")
        .unwrap()
        .flatten()
        .map(|entry| entry.file_name())
        .filter(|name| name.as_encoded_bytes().starts_with(prefix.as_bytes()))
        .collect();
    assert!(shared.is_empty(), "left in /dev/shm: {shared:?}");
    let root = format!("/tmp/firsthand-{user}/{robot}");
    assert!(!Path::new(&root).exists(), "{root} is left");
    assert_eq!(processes_of(robot), Vec::<String>::new());
}

/// In the name of every directory that a run of `robot` in these tests uses.
fn mark(robot: &str) -> String {
    format!("firsthand-test-{robot}_")
}

/// Command lines of the processes that work for `robot`: supervisor, stages, simulator.
pub fn processes_of(robot: &str) -> Vec<String> {
    found(robot).map(|(_, line)| line).collect()
}

/// Their numbers.
pub fn pids_of(robot: &str) -> Vec<u32> {
    found(robot).map(|(pid, _)| pid).collect()
}

/// Wait until no process works for `robot` any more.
pub fn wait_until_all_ended(robot: &str) {
    let began = Instant::now();
    while !pids_of(robot).is_empty() {
        assert!(began.elapsed() < PATIENCE, "{:?}", pids_of(robot));
    }
}

fn found(robot: &str) -> impl Iterator<Item = (u32, String)> {
    let mark = mark(robot);
    let entries = fs::read_dir("/proc").unwrap().flatten();
    entries.filter_map(move |entry| {
        let pid = entry.file_name().to_str()?.parse().ok()?;
        let line = fs::read(entry.path().join("cmdline")).ok()?;
        let line = String::from_utf8_lossy(&line).replace('\0', " ");
        line.contains(&mark).then_some((pid, line))
    })
}
