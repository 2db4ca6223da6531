//! Tests of the guide's example robot in Python, which sends JSON lines.

use std::{
    io::{BufRead as _, BufReader},
    process::Child,
    thread::{self, JoinHandle},
};

use rustix::process::Signal;
use serde_json::Value;

use crate::support::{Run, assert_no_restart, kill, start_piped, with_parent};

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
        let program = format!("{EXAMPLE}/robot.py");
        let mut process = start_piped(&mut with_parent(&["python3", &program, "0"]));
        let mut says = BufReader::new(process.stdout.take().unwrap());
        let mut first = String::new();
        says.read_line(&mut first).unwrap();
        let first: Value = serde_json::from_str(&first).unwrap();
        let last = thread::spawn(|| says.lines().map_while(Result::ok).last().unwrap());
        Self { process, last, port: first["port"].as_u64().unwrap() }
    }

    fn run(&self, robot: &str, more: &str) -> Run {
        let address = format!("--set robot.address='udp://127.0.0.1:{}'", self.port);
        let near = "--set controller.speed_m_s=0.5 --set target=[3,0]";
        Run::start(robot, &format!("{EXAMPLE}/robot.toml"), &format!("{address} {near} {more}"))
    }

    /// Ends the robot. Returns its last line about itself.
    fn end(mut self) -> Value {
        kill(&mut self.process);
        serde_json::from_str(&self.last.join().unwrap()).unwrap()
    }
}

#[test]
fn a_robot_in_python_arrives_untouched_though_each_stage_is_killed() {
    let robot = PythonRobot::start();
    let mut run = robot.run("json-kills", "");
    run.wait_until_under_way(0.3);
    run.kill_each(Signal::KILL);
    run.arrives();
    let truth = robot.end();
    let [x, y] = ["x", "y"].map(|axis| truth[axis].as_f64().unwrap());
    assert!((x - 3.0).hypot(y) < 0.5, "{truth}");
    assert_eq!(truth["touches"], 0, "{truth}");
    assert_eq!(truth["told"], serde_json::json!([0.0, 0.0]), "{truth}");
}

#[test]
fn a_run_whose_robot_names_a_sensor_otherwise_ends_with_both_names_and_blames_no_stage() {
    let robot = PythonRobot::start();
    let nose = "--set robot.sensor=[{name='nose',kind='cone',forward_m=0.2,bearing_deg=0}]";
    let summary = robot.run("json-nose", nose).ends(6, "aborted");
    let reason = summary["reason"].as_str().unwrap();
    assert!(
        reason
            .contains("no row of robot.sensor is named \"front\"; send one of the names [\"nose\""),
        "{summary}"
    );
    assert_no_restart(&summary);
}
