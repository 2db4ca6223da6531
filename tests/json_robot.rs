//! Robots that speak JSON lines: the simulated one, and the guide's independent example in Python.

use std::{
    fs,
    io::{BufRead as _, BufReader},
    path::Path,
    process::{Child, Command, Stdio},
    thread::{self, JoinHandle},
};

use rustix::process::Signal;
use serde_json::Value;

use crate::support::{Run, assert_ended, assert_no_restart, assert_reached, replayed_in};

const EXAMPLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../guide/example-robot");

struct PythonRobot {
    process: Child,
    /// Thread that drains the robot's own lines, so that the robot never waits, and returns the
    /// last.
    last: JoinHandle<String>,
    port: u64,
}

impl PythonRobot {
    fn start() -> Self {
        Self::start_with(&[])
    }

    /// Starts a robot. `options` are the acceleration of its wheels, m/s^2, and their delay,
    /// seconds.
    fn start_with(options: &[&str]) -> Self {
        let mut process = Command::new("setpriv")
            .args(["--pdeathsig", "KILL", "--", "python3"])
            .args([&format!("{EXAMPLE}/robot.py"), "0"])
            .args(options)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut says = BufReader::new(process.stdout.take().unwrap());
        let mut first = String::new();
        says.read_line(&mut first).unwrap();
        let first: Value = serde_json::from_str(&first).unwrap();
        let last = thread::spawn(|| says.lines().map_while(Result::ok).last().unwrap());
        Self { process, last, port: first["port"].as_u64().unwrap() }
    }

    fn run(&self, robot: &str) -> Run {
        self.run_with(robot, &[])
    }

    fn run_with(&self, robot: &str, set: &[&str]) -> Run {
        let address = format!("robot.address='udp://127.0.0.1:{}'", self.port);
        let fast = "controller.speed_m_s=0.5";
        let near = "target=[3, 0]";
        let set = [&["--set", &address, "--set", fast, "--set", near], set].concat();
        Run::start(robot, &format!("{EXAMPLE}/robot.toml"), &set)
    }

    /// Ends the robot. Returns its last line about itself.
    fn end(mut self) -> Value {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
        serde_json::from_str(&self.last.join().unwrap()).unwrap()
    }
}

#[track_caller]
fn assert_at_its_target_untouched(truth: &Value) {
    let [x, y] = ["x", "y"].map(|axis| truth[axis].as_f64().unwrap());
    assert!((x - 3.0).hypot(y) < 0.5, "{truth}");
    assert_eq!(truth["touches"], 0, "{truth}");
    assert_eq!(truth["told"], serde_json::json!([0.0, 0.0]), "{truth}");
}

#[test]
fn a_robot_in_python_is_driven_past_drums_to_its_target() {
    let robot = PythonRobot::start();
    let (code, summary) = robot.run("json-py").finish();
    assert_reached(code, &summary);
    assert_at_its_target_untouched(&robot.end());
}

#[test]
fn a_robot_in_python_arrives_untouched_though_each_stage_is_killed() {
    let robot = PythonRobot::start();
    let mut run = robot.run("json-kills");
    run.wait_until_under_way(0.3);
    run.kill_each(Signal::KILL);
    let (code, summary) = run.finish();
    assert_reached(code, &summary);
    assert_at_its_target_untouched(&robot.end());
}

#[test]
fn a_run_whose_robot_names_a_sensor_otherwise_ends_with_both_names_and_blames_no_stage() {
    let robot = PythonRobot::start();
    let nose = "robot.sensor=[{name='nose',kind='cone',forward_m=0.2,bearing_deg=0}]";
    let (code, summary) = robot.run_with("json-nose", &["--set", nose]).finish();
    assert_ended(code, &summary, 6, "aborted");
    let reason = summary["reason"].as_str().unwrap();
    assert!(reason.contains("no sensor is named \"front\"; rename it to one of nose"), "{summary}");
    assert_no_restart(&summary);
}

/// Returns whether the link of a run reports that the base responds otherwise than stated.
fn names_the_response(run: &Path) -> bool {
    let log = fs::read_to_string(run.join("link.log")).unwrap();
    assert!(!log.contains("counts do not follow"), "{log}");
    log.contains("the base answers after")
}

#[test]
fn a_heavy_late_robot_arrives_untouched_as_stated_and_is_named_where_nothing_is_stated() {
    let stated = ["--set", "robot.response={delay_s=0.3,acceleration_m_s2=0.6}"];
    let robots = [("json-stated", &stated[..], false), ("json-heavy", &[], true)];
    let runs = robots.map(|(robot, set, named)| {
        let python = PythonRobot::start_with(&["0.6", "0.3"]);
        let unsure = ["--set", "sure_within_m=2"];
        let run = python.run_with(robot, &[set, &unsure].concat());
        (python, run, named)
    });
    for (python, run, named) in runs {
        let (summary, directory) = run.arrives_in();
        assert_eq!(names_the_response(&directory.path().join("run")), named, "{summary}");
        assert_at_its_target_untouched(&python.end());
    }
}

#[test]
fn a_simulated_robot_that_speaks_json_arrives_and_replays_to_the_bit() {
    let protocol = ["--pace", "4", "--set", "robot.protocol='json'"];
    let (_, directory) = Run::start("json-sim", "obstacle-course", &protocol).arrives_in();
    assert_eq!(replayed_in(&directory).equal(), 5);
}
