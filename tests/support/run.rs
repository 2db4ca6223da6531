use std::{
    fs,
    io::Read as _,
    path::{Path, PathBuf},
    process::{Child, Stdio},
};

use common::{samples::PoseSample, topics};
use recording::{
    Recording,
    replay::{Options, Report, replay},
};
use rustix::process::Signal;
use serde_json::Value;
use tempfile::TempDir;

use super::{
    commands::{firsthand, json_lines, start_piped, words},
    robot::{
        STAGES, all_run, assert_nothing_left, directory_of, follow_status, generation, pid,
        signal_process, status_of,
    },
};

/// Run of a mission by a robot that no other test uses.
pub struct Run {
    pub robot: String,
    child: Option<Child>,
    directory: TempDir,
    /// Whether the stop guard continues after the run. Otherwise the end of the test signs the
    /// robot off.
    pub keeps_guard: bool,
}

impl Run {
    /// Starts `firsthand run MISSION --robot ROBOT --json` with further arguments.
    ///
    /// Its defaults suit tests. Uncalibrated wheels do not make the arrival unsure. The timeout
    /// allows for slow process starts on a busy machine. The robot is slow, so that a test can act
    /// while it drives.
    pub fn start(robot: &str, mission: &str, line: &str) -> Self {
        Self::at_own_speed(robot, mission, &format!("--set controller.speed_m_s=0.2 {line}"))
    }

    /// Starts like [`Self::start`], at the mission's own speed.
    pub fn at_own_speed(robot: &str, mission: &str, line: &str) -> Self {
        let directory = directory_of(robot);
        let out = directory.path().join("run");
        let mut run = firsthand(&["run", mission, "--robot", robot, "--json", "--out"]);
        run.arg(&out).args(["--set", "sure_within_m=9", "--set", "timeout_s=900"]);
        let child = Some(start_piped(run.args(words(line)).stderr(Stdio::piped())));
        Self { robot: robot.to_owned(), child, directory, keeps_guard: false }
    }

    /// Starts, and waits for `seconds` of mission time.
    pub fn under_way(robot: &str, mission: &str, line: &str, seconds: f64) -> Self {
        let mut run = Self::start(robot, mission, line);
        run.wait_until_under_way(seconds);
        run
    }

    pub fn directory(&self) -> PathBuf {
        self.directory.path().join("run")
    }

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

    pub fn status(&self) -> Option<Value> {
        status_of(&self.robot)
    }

    pub fn wait_until(&mut self, what: &str, is_so: impl Fn(&Value) -> bool) -> Value {
        let child = self.child.as_mut().unwrap();
        follow_status(&self.robot, is_so, || {
            if let Some(exit) = child.try_wait().unwrap() {
                let mut said = String::new();
                let _ = child.stderr.take().unwrap().read_to_string(&mut said);
                panic!("the run ended ({exit}) before {what}: {said}");
            }
        })
    }

    /// Waits for `seconds` of mission time, and until every stage runs.
    pub fn wait_until_under_way(&mut self, seconds: f64) -> Value {
        self.wait_until("the robot is under way", |status| {
            status["mission_time_s"].as_f64().unwrap() >= seconds && all_run(status)
        })
    }

    pub fn wait_until_driving(&mut self) -> Value {
        self.wait_until("the robot drives", |status| status["order"] == "driving")
    }

    pub fn wait_until_all_run(&mut self) -> Value {
        self.wait_until("every stage runs", all_run)
    }

    pub fn reap(&mut self) {
        self.child.as_mut().unwrap().wait().unwrap();
    }

    pub fn kill(&mut self) {
        self.signal(Signal::KILL);
        self.reap();
    }

    pub fn signal(&self, signal: Signal) {
        signal_process(self.pid(), signal);
    }

    /// Kills or freezes a stage. Returns the status once all stages run again.
    pub fn kill_and_await_successor(&mut self, stage: &str, signal: Signal) -> Value {
        let status = self.wait_until_all_run();
        self.kill_and_await(stage, signal, &status)
    }

    /// [`Self::kill_and_await_successor`] from a known `status`, which saves seconds.
    pub fn kill_and_await(&mut self, stage: &str, signal: Signal, status: &Value) -> Value {
        signal_process(pid(status, stage), signal);
        let before = generation(status, stage);
        self.wait_until("its successor runs", |status| {
            generation(status, stage) > before && all_run(status)
        })
    }

    /// Kills or freezes each stage, as soon as its predecessor's successor runs.
    pub fn kill_each(&mut self, signal: Signal) {
        let mut status = self.wait_until_all_run();
        for stage in STAGES {
            status = self.kill_and_await(stage, signal, &status);
        }
    }

    /// Waits for the end. Returns the exit code, and the JSON of the last line.
    pub fn finish(self) -> (Option<i32>, Value) {
        let (code, summary, _) = self.finish_in();
        (code, summary)
    }

    /// [`Self::finish`] that also returns the directory above the run's.
    pub fn finish_in(mut self) -> (Option<i32>, Value, TempDir) {
        let output = self.child.take().unwrap().wait_with_output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout);
        let last = text.lines().last().unwrap_or_default();
        let summary = serde_json::from_str(last).unwrap_or_else(|_| panic!("{output:?}"));
        let directory = std::mem::replace(&mut self.directory, tempfile::tempdir().unwrap());
        (output.status.code(), summary, directory)
    }

    /// Waits for the end. Asserts that the robot reached its target, touched nothing, and left
    /// nothing.
    #[track_caller]
    pub fn arrives(self) -> Value {
        self.arrives_in().0
    }

    /// [`Self::arrives`] that also returns the directory above the run's.
    #[track_caller]
    pub fn arrives_in(self) -> (Value, TempDir) {
        let robot = self.robot.clone();
        let (code, summary, directory) = self.finish_in();
        assert_reached(code, &summary);
        assert_nothing_left(&robot);
        (summary, directory)
    }

    /// Waits for the end. Asserts exit code and outcome, and that the robot left nothing.
    #[track_caller]
    pub fn ends(self, code: i32, outcome: &str) -> Value {
        let robot = self.robot.clone();
        let (found, summary) = self.finish();
        assert_ended(found, &summary, code, outcome);
        assert_nothing_left(&robot);
        summary
    }

    /// Stops the run with SIGTERM. Asserts that it ends in order and leaves nothing.
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

/// Leaves no process after a failed test, because stages end with their supervisor.
impl Drop for Run {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            let _ = child.kill();
            let _ = child.wait();
        }
        // A test that ends its robot leaves a stop guard, which orders the stop.
        if !self.keeps_guard && super::domain(&self.robot).owed_stop().symlink_metadata().is_ok() {
            let _ = firsthand(&["stop", "--sign-off", "--robot", &self.robot]).output();
        }
    }
}

/// Asserts that the robot has reached its target and touched nothing.
#[track_caller]
pub fn assert_reached(code: Option<i32>, summary: &Value) {
    assert_ended(code, summary, 0, "reached");
    assert_eq!(summary["collisions"].as_u64().unwrap_or(0), 0, "{summary}");
}

#[track_caller]
pub fn assert_ended(code: Option<i32>, summary: &Value, expected: i32, outcome: &str) {
    let ended = (code, &summary["outcome"]);
    assert_eq!(ended, (Some(expected), &outcome.into()), "{summary}");
}

#[track_caller]
pub fn assert_no_restart(summary: &Value) {
    let mut restarts = summary["restarts"].as_object().unwrap().values();
    assert!(restarts.all(|times| times == 0), "{summary}");
}

/// Asserts that every stage was restarted, as with a recreated bus.
#[track_caller]
pub fn assert_each_restarted(summary: &Value) {
    for stage in STAGES {
        assert!(summary["restarts"][stage].as_u64() >= Some(1), "{stage}: {summary}");
    }
}

/// Reads a file of records, one JSON value per line. A missing file has none.
pub fn records(file: &Path) -> Vec<Value> {
    json_lines(&fs::read_to_string(file).unwrap_or_default())
}

/// Counts the lines of a process's log in a run's directory that contain all `parts`, a level and
/// fields.
pub fn logged(directory: &Path, process: &str, parts: &[&str]) -> usize {
    let log = fs::read_to_string(directory.join(format!("{process}.log"))).unwrap_or_default();
    let has_all = |line: &&str| parts.iter().all(|part| line.contains(part));
    log.lines().filter(has_all).count()
}

pub fn run(robot: &str, mission: &str, line: &str) -> (Option<i32>, Value) {
    Run::at_own_speed(robot, mission, line).finish()
}

/// Replays the recording of a run, given the directory above the run's.
///
/// Asserts that every generation of every stage is bit-equal, or ended before its first input.
#[track_caller]
pub fn replayed_in(directory: &TempDir) -> Report {
    replayed(&recording_in(directory))
}

/// Opens the recording of a run, given the directory above the run's.
pub fn recording_in(directory: &TempDir) -> Recording {
    Recording::open(&directory.path().join("run/recording.mcap")).unwrap()
}

/// [`replayed_in`] for a recording.
#[track_caller]
pub fn replayed(recording: &Recording) -> Report {
    let report = replay(recording, &Options::default()).unwrap();
    assert_eq!(report.difference, None, "{report}");
    assert_eq!(report.not_replayed(), 0, "{report}");
    report
}

/// Writes a mission file.
pub fn mission_file(text: &str) -> (TempDir, String) {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("mission.toml");
    fs::write(&file, text).unwrap();
    (directory, file.to_str().unwrap().to_owned())
}

/// Replays what the recordings of a run hold, killed or not. Returns the poses.
#[track_caller]
pub fn replayed_poses(run: &Path) -> Vec<PoseSample> {
    let files = fs::read_dir(run).unwrap().map(|file| file.unwrap().path());
    let mut poses = Vec::new();
    for file in files.filter(|file| file.extension().is_some_and(|it| it == "mcap")) {
        let recording = Recording::open(&file).unwrap();
        let report = replay(&recording, &Options::default()).unwrap();
        assert!(report.difference.is_none() && report.equal() > 0, "{report}");
        poses.extend(recording.samples(&topics::POSE).unwrap().map(Result::unwrap));
    }
    assert!(!poses.is_empty());
    poses
}

/// Returns the outcome of each target.
pub fn outcomes(summary: &Value) -> Vec<&str> {
    let targets = summary["targets"].as_array().unwrap();
    targets.iter().map(|target| target["outcome"].as_str().unwrap()).collect()
}

/// Opens the committed recording of the first seconds of a mission.
pub fn golden() -> Recording {
    golden_of("open-room")
}

pub fn golden_of(name: &str) -> Recording {
    let directory = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/golden");
    Recording::open(&Path::new(directory).join(name).with_extension("mcap")).unwrap()
}
