//! Shared by the system tests: the real executable, robots, states to wait for.
//!
//! Every test names its own robots. Each process that a test starts gets SIGKILL when the test ends, however it ends, so that
//! a suite that was killed leaves nothing that hinders the next.
#![allow(dead_code, clippy::unwrap_used, clippy::panic, missing_docs, unreachable_pub)]

pub mod wire;

use std::{
    fs,
    io::{Read as _, Write as _},
    os::unix::fs::PermissionsExt as _,
    path::{Path, PathBuf},
    process::{Child, Command, ExitStatus, Output, Stdio},
    sync::atomic::{AtomicUsize, Ordering},
    time::{Duration, Instant},
};

use common::{bus_instance::BusInstance, domain::Domain};
use recording::Recording;
use rustix::process::{Pid, Signal, getegid, geteuid, kill_process};
use serde_json::Value;
use tempfile::TempDir;

/// Every stage, in the order of the pipeline.
pub const STAGES: [&str; 5] = ["x80-link", "dead-reckoning", "mapper", "planner", "controller"];

/// Nothing a test waits for takes nearly as long; what does is broken.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Call `is_so` until it is, for [`PATIENCE`] at most.
pub fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let began = Instant::now();
    while !is_so() {
        assert!(began.elapsed() < PATIENCE, "waited too long until {what}");
    }
}

/// Names the one test that a process is for.
const OWN_PROCESS: &str = "FIRSTHAND_TEST";

/// Run `test` in a process of its own: what it leaves of the bus of its robot ends with it.
pub fn in_own_process<T: FnOnce()>(test: T) {
    in_process_under(&[], name_of::<T>(), test);
}

/// Run `test` in a process of its own with a file system of so many MiB, which an ordinary user may mount in namespaces of
/// user and mounts. Where the system allows none, the test does not run and says so.
pub fn on_small_disk<T: FnOnce(SmallDisk)>(mebibytes: u32, test: T) {
    let namespaces = ["unshare", "--user", "--map-root-user", "--mount"];
    if !can_run(&namespaces) {
        return not_run(name_of::<T>(), "no user namespace with mounts can be had here");
    }
    let directory = tempfile::tempdir().unwrap();
    // The inner namespace gives the test its own user back: files of the robot have that user's number in their names.
    let script = format!(
        "mount -t tmpfs -o size={mebibytes}m tmpfs {disk} && exec unshare --user --map-user={user} --map-group={group} \
         -- env {DISK}={disk} \"$@\"",
        disk = directory.path().display(),
        user = geteuid().as_raw(),
        group = getegid().as_raw(),
    );
    let wrapper = [&namespaces[..], &["sh", "-c", &script, "sh"]].concat();
    in_process_under(&wrapper, name_of::<T>(), || {
        test(SmallDisk(std::env::var_os(DISK).unwrap().into()));
    });
}

/// Names the directory where the small disk of a test is mounted.
const DISK: &str = "FIRSTHAND_TEST_DISK";

/// A small file system, until the process of its test ends.
pub struct SmallDisk(PathBuf);

impl SmallDisk {
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Use up the free space.
    pub fn fill(&self) {
        let mut file = fs::File::create(self.0.join("filler")).unwrap();
        let refused = std::iter::repeat_with(|| file.write_all(&[1; 4096])).find_map(Result::err);
        assert_eq!(refused.unwrap().kind(), std::io::ErrorKind::StorageFull);
    }
}

/// Whether this user may start a process so.
pub fn can_run(wrapper: &[&str]) -> bool {
    let mut command = Command::new(wrapper[0]);
    let output = command.args(&wrapper[1..]).arg("true").output();
    output.is_ok_and(|output| output.status.success())
}

/// Tests of this executable that did not run.
static NOT_RUN: AtomicUsize = AtomicUsize::new(0);

/// Say that `test` did not run, and count it. It is written past the harness, which prints nothing of a test that passes.
pub fn not_run(test: &str, why: &str) {
    let count = NOT_RUN.fetch_add(1, Ordering::Relaxed) + 1;
    let said = format!("\nNOT RUN ({count}): {test}: {why}\n");
    std::io::stderr().write_all(said.as_bytes()).unwrap();
}

/// The name of the test that a closure of type `T` is in: CRATE::MODULE::TEST::{{closure}}.
fn name_of<T>() -> &'static str {
    let (_, name) = std::any::type_name::<T>().split_once("::").unwrap();
    name.split("::{{closure}}").next().unwrap()
}

fn in_process_under(wrapper: &[&str], name: &str, test: impl FnOnce()) {
    if std::env::var_os(OWN_PROCESS).is_some_and(|chosen| chosen == name) {
        return test();
    }
    let executable = std::env::current_exe().unwrap();
    let output = with_parent(wrapper)
        .arg(executable)
        .args([name, "--exact", "--nocapture"])
        .env(OWN_PROCESS, name)
        .output()
        .unwrap();
    let (printed, said) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let passed = output.status.success() && printed.contains("1 passed");
    assert!(passed, "{printed}\n{said}");
}

/// A command that gets SIGKILL when the thread that starts it ends.
fn with_parent(line: &[&str]) -> Command {
    let mut command = Command::new("setpriv");
    command.args(["--pdeathsig", "KILL", "--"]).args(line);
    command
}

/// `firsthand` with these arguments.
pub fn firsthand(arguments: &[&str]) -> Command {
    firsthand_under(&[], arguments)
}

/// The same, started by `wrapper`.
pub fn firsthand_under(wrapper: &[&str], arguments: &[&str]) -> Command {
    let mut command = with_parent(wrapper);
    command.arg(env!("CARGO_BIN_EXE_firsthand"));
    command.args(arguments).stdin(Stdio::null());
    command
}

/// Start it without output.
pub fn start_quietly(command: &mut Command) -> Child {
    let quiet = command.stdout(Stdio::null()).stderr(Stdio::null());
    quiet.spawn().unwrap()
}

/// Run it to its end.
pub fn output(arguments: &[&str]) -> Output {
    firsthand(arguments).output().unwrap()
}

/// What a command prints that must succeed.
pub fn printed(arguments: &[&str]) -> String {
    let output = output(arguments);
    assert!(output.status.success(), "{arguments:?}: {output:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// The JSON values that a command prints, one a line, and how it ended.
pub fn json_of(output: &Output) -> (ExitStatus, Vec<Value>) {
    let text = String::from_utf8_lossy(&output.stdout);
    let values: Result<_, _> = text.lines().map(serde_json::from_str).collect();
    let values = values.unwrap_or_else(|error| panic!("{error}: {output:?}"));
    (output.status, values)
}

/// `firsthand` with these arguments for `robot`, which must succeed.
pub fn operate(robot: &str, arguments: &[&str]) {
    printed(&[arguments, &["--robot", robot]].concat());
}

/// A command that must fail with the error `code` ("usage" where the command line is wrong, "" where there is none), and
/// whose message has each of `names`: what was wrong, or what to give instead. Its exit code.
#[track_caller]
pub fn refused(arguments: &[&str], code: &str, names: &[&str]) -> Option<i32> {
    assert_refused(&output(arguments), code, names)
}

/// As [`refused`], of a command that has ended.
#[track_caller]
pub fn assert_refused(output: &Output, code: &str, names: &[&str]) -> Option<i32> {
    let said = String::from_utf8_lossy(&output.stderr);
    let exit = output.status.code();
    assert!(!output.status.success(), "{output:?}");
    assert!(!said.contains("panicked"), "{said}");
    let coded = |line: &str| Some(line.strip_suffix(']')?.rsplit_once(" [")?.1.to_owned());
    let found = match exit {
        Some(2) => "usage".to_owned(),
        _ => said.lines().find_map(coded).unwrap_or_default(),
    };
    assert_eq!(found, code, "{said}");
    for name in names {
        assert!(said.contains(name), "{name:?} is not named: {said}");
    }
    exit
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
        Self { robot: robot.to_owned(), child: Some(child), directory }
    }

    pub fn directory(&self) -> PathBuf {
        self.directory.path().join("run")
    }

    /// The lines of a file of records in the run directory.
    pub fn records(&self, file: &str) -> Vec<Value> {
        records(&self.directory().join(file))
    }

    /// Whether a line of the link's log has all these: a level, fields.
    pub fn link_logged(&self, parts: &[&str]) -> bool {
        logged(&self.directory(), "x80-link", parts) > 0
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

    pub fn wait_until_driving(&mut self) -> Value {
        self.wait_until("the robot drives", |status| status["order"] == "driving")
    }

    /// Until every stage runs.
    pub fn wait_until_all_run(&mut self) -> Value {
        self.wait_until("every stage runs", all_run)
    }

    /// Wait until the supervisor itself is gone.
    pub fn reap(&mut self) {
        self.child.as_mut().unwrap().wait().unwrap();
    }

    /// Kill the supervisor.
    pub fn kill(&mut self) {
        self.signal(Signal::KILL);
        self.reap();
    }

    pub fn signal(&self, signal: Signal) {
        signal_process(self.pid(), signal);
    }

    /// Kill a stage, or freeze it (`Signal::STOP`), and wait until its successor runs; the status then.
    pub fn kill_and_await_successor(&mut self, stage: &str, signal: Signal) -> Value {
        let status =
            self.wait_until("the stage runs", |status| find(status, stage)["state"] == "running");
        self.kill_and_await(stage, signal, &status)
    }

    /// As [`Self::kill_and_await_successor`], for a stage that runs in `status`, where no further status can be had.
    pub fn kill_and_await(&mut self, stage: &str, signal: Signal, status: &Value) -> Value {
        signal_process(pid(status, stage), signal);
        let before = generation(status, stage);
        self.wait_until("its successor runs", |status| {
            generation(status, stage) > before && find(status, stage)["state"] == "running"
        })
    }

    /// Wait for the end: exit code, and the JSON of the last line.
    pub fn finish(self) -> (Option<i32>, Value) {
        let (code, summary, _) = self.finish_in();
        (code, summary)
    }

    /// Wait for the end; the run's directory is below the one returned.
    pub fn finish_in(mut self) -> (Option<i32>, Value, TempDir) {
        let output = self.child.take().unwrap().wait_with_output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout);
        let last = text.lines().last().unwrap_or_default();
        let summary = serde_json::from_str(last).unwrap_or_else(|_| panic!("{output:?}"));
        let directory = std::mem::replace(&mut self.directory, tempfile::tempdir().unwrap());
        (output.status.code(), summary, directory)
    }

    /// Wait for the end: the robot has reached its target, touched nothing, and nothing of it is left.
    #[track_caller]
    pub fn arrives(self) -> Value {
        self.arrives_in().0
    }

    /// As [`Self::arrives`]; the run's directory is below the one returned.
    #[track_caller]
    pub fn arrives_in(self) -> (Value, TempDir) {
        let robot = self.robot.clone();
        let (code, summary, directory) = self.finish_in();
        assert_reached(code, &summary);
        assert_nothing_left(&robot);
        (summary, directory)
    }

    /// Stop the run with SIGTERM: it ends in order, and nothing of it is left.
    #[track_caller]
    pub fn stop(self) -> Value {
        self.signal(Signal::TERM);
        let robot = self.robot.clone();
        let (code, summary) = self.finish();
        assert_eq!(code, Some(0), "{summary}");
        assert_nothing_left(&robot);
        summary
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

/// The robot has reached its target and touched nothing.
#[track_caller]
pub fn assert_reached(code: Option<i32>, summary: &Value) {
    assert_ended(code, summary, 0, "reached");
    assert_eq!(summary["collisions"].as_u64().unwrap_or(0), 0, "{summary}");
}

/// A run ended with that exit code and outcome.
#[track_caller]
pub fn assert_ended(code: Option<i32>, summary: &Value, expected: i32, outcome: &str) {
    let ended = (code, &summary["outcome"]);
    assert_eq!(ended, (Some(expected), &outcome.into()), "{summary}");
}

/// The lines of a file of records: a JSON value each, none before the first.
pub fn records(file: &Path) -> Vec<Value> {
    let text = fs::read_to_string(file).unwrap_or_default();
    let lines = text.lines().map(|line| serde_json::from_str(line).unwrap());
    lines.collect()
}

/// The lines in the log of a process in a run's directory that have all these `parts`: a level, fields.
pub fn logged(directory: &Path, process: &str, parts: &[&str]) -> usize {
    let log = fs::read_to_string(directory.join(format!("{process}.log"))).unwrap_or_default();
    let has_all = |line: &&str| parts.iter().all(|part| line.contains(part));
    log.lines().filter(has_all).count()
}

/// A whole run.
pub fn run(robot: &str, mission: &str, arguments: &[&str]) -> (Option<i32>, Value) {
    Run::start(robot, mission, arguments).finish()
}

/// The committed recording of the first seconds of a mission.
pub fn golden() -> Recording {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/golden/open-room.mcap");
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

/// Which of its processes that is.
pub fn generation(status: &Value, stage: &str) -> u64 {
    find(status, stage)["generation"].as_u64().unwrap()
}

/// Whether every stage runs.
pub fn all_run(status: &Value) -> bool {
    let mut stages = STAGES.iter().map(|stage| find(status, stage));
    stages.all(|stage| stage["state"] == "running")
}

/// Leave a file of the middleware as it is between its creation and its completion.
pub fn half_make(path: &Path) {
    // An existing one may not be writable.
    let _ = fs::remove_file(path);
    let file = fs::File::create(path).unwrap();
    file.set_permissions(fs::Permissions::from_mode(0o200)).unwrap();
}

pub fn domain(robot: &str) -> Domain {
    Domain::of(robot.parse().unwrap())
}

/// The present bus instance of `robot`.
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
#[track_caller]
pub fn assert_nothing_left(robot: &str) {
    let domain = domain(robot);
    let shared = shared_memory(&domain.shared_memory_prefix());
    assert!(shared.is_empty(), "left in shared memory: {shared:?}");
    let directory = domain.directory();
    assert!(!directory.exists(), "{} is left", directory.display());
    assert_eq!(processes_of(robot), Vec::<String>::new());
}

/// In the name of every directory that a run of `robot` in these tests uses.
fn mark(robot: &str) -> String {
    format!("firsthand-test-{robot}_")
}

/// Command lines of the processes that work for `robot`: supervisor, stages, simulator.
pub fn processes_of(robot: &str) -> Vec<String> {
    let found = processes(&mark(robot)).into_iter();
    found.map(|(_, line)| line).collect()
}

/// Their numbers.
pub fn pids_of(robot: &str) -> Vec<u32> {
    let found = processes(&mark(robot)).into_iter();
    found.map(|(pid, _)| pid).collect()
}

/// Wait until no process works for `robot` any more.
pub fn wait_until_all_ended(robot: &str) {
    wait_until("all have ended", || pids_of(robot).is_empty());
}

/// Numbers and command lines of the processes whose command lines contain `mark`.
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
